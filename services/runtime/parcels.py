"""Files of others that senses need: in which package of which registry they lie, how they are known, and where they
are kept. `engage eyes install` fetches them (services/commandline/robot/eyes.py); a service only reads them.
"""

import os
import sys
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple


class Parcel(NamedTuple):
    """Files of one package. file: that of the package, which the client of the registry finds by name and version.

    files: SHA-256 of each that is kept, by its place in that file. purpose: what needs them. platform: tags of the
    file, for pip.
    """

    registry: Literal["PyPI", "npm"]
    name: str
    version: str
    file: str
    sha256: str
    files: dict[str, str]
    license: str
    purpose: str
    platform: tuple[str, ...] = ()

    def names(self) -> list[str]:
        """Names under which the files are kept."""
        return [PurePosixPath(each).name for each in self.files]


DETECTOR = "face_detection_short_range.tflite"
MESH = "face_landmark.tflite"
RUNTIME = "litert_wasm_compat_internal"
FACE_MODELS = Parcel(
    registry="PyPI",
    name="mediapipe",
    version="0.10.21",
    file="mediapipe-0.10.21-cp311-cp311-manylinux_2_28_x86_64.whl",
    sha256="05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3",
    files={
        f"mediapipe/modules/face_detection/{DETECTOR}":
            "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
        f"mediapipe/modules/face_landmark/{MESH}":
            "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
        "mediapipe-0.10.21.dist-info/LICENSE":
            "8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8",
    },
    license="Apache-2.0",
    purpose="models of faces",
    platform=("--python-version", "3.11", "--implementation", "cp", "--platform", "manylinux_2_28_x86_64"),
)  # fmt: skip
"""The face models. This wheel is the last that holds them; none of its code is used, and they suit every machine."""
PAGE_RUNTIME = Parcel(
    registry="npm",
    name="@litertjs/core",
    version="2.5.3",
    file="litertjs-core-2.5.3.tgz",
    sha256="a97660833e9e7e1063c95e12016718881240b14f7438728a2f62785e912d30fd",
    files={
        f"package/wasm/{RUNTIME}.js": "4d8f894b7883654fd6e8439730aa41e79ceaab7d19184fc4f1f0b0f1a2a2c8a5",
        f"package/wasm/{RUNTIME}.wasm": "5255c8ad06eabdbd2522cdebf6b22fc10faf74625c23a49b9e072570cd1fa41c",
        "package/package.json": "1ba6b1c4b25c061cf97876e4846be92f8dfe312d2f78d82ee3ee92ab45c80987",
    },
    license="Apache-2.0",
    purpose="what runs these models in the browser of who sits at a page",
)
"""The runtime for pages, of four the one that every browser can run. package.json names its license; the text is that
of the models."""
TURN_MODEL = Parcel(
    registry="PyPI",
    name="pipecat-ai",
    version="1.14.0",
    file="pipecat_ai-1.14.0-py3-none-any.whl",
    sha256="0352f504b44e78bdf524e45af4bc759601c835b9b7dc195efe5e03384b974a44",
    files={
        "pipecat/audio/turn/smart_turn/data/smart-turn-v3.2-cpu.onnx":
            "2bb026316b14a660486a75b1733cd3fbab8c2fd0314dc9af7be49f8cca967e4f",
        "pipecat_ai-1.14.0.dist-info/licenses/LICENSE":
            "e31a733ecb79cbffafd5474e964e5eca15e0a0876a42b1d7253b51b198eb61aa",
    },
    license="BSD-2-Clause",
    purpose="model of how turns end",
)  # fmt: skip
PARCELS = {"eyes": (FACE_MODELS, PAGE_RUNTIME), "hearing": (TURN_MODEL,)}
"""By the sense that needs them."""


def data_folder(sense: str) -> Path:
    """Folder of this user in which the models of a sense are kept.

    It lies in `ENGAGE_DATA`, or where data of programs lies here.
    """
    if own := os.environ.get("ENGAGE_DATA", ""):
        return Path(own) / sense
    if sys.platform == "darwin":
        data = Path.home() / "Library/Application Support"
    elif sys.platform == "win32":
        data = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local"))
    else:
        data = Path(os.environ.get("XDG_DATA_HOME", "") or Path.home() / ".local/share")
    return data / "engage" / sense
