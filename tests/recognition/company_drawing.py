"""Talk of two to five people and a robot that speaks to one, several or all of them, drawn at random."""

from tests.recognition.drawing import Drawing


class CompanyDrawing(Drawing):
    """A timeline of company."""

    SIZES = (2, 3, 4, 5)

    def _asked(self, to: str, kind: str, at: float, until: float) -> tuple[str, ...]:
        here = [each for each in self.timeline.people if not self._is_away(each, at - 2.5, until + 0.1)]
        if kind != "asks" or to not in here or self._chance.random() < 0.4:
            return super()._asked(to, kind, at, until)
        others = [each for each in here if each != to]
        return (
            to,
            *self._chance.sample(others, self._chance.choice((len(others), self._chance.randint(0, len(others))))),
        )
