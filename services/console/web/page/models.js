// Models on LiteRT's runtime for browsers, which `engage eyes install` has fetched: each is a function from numbers to its outputs.

// factory: of the runtime, as its script has it. place: URL of the folder of the runtime and the models. names: of their files. Raises what could not be had.
export async function models(factory, place, names) {
  const read = async (name) => {
    const answer = await fetch(new URL(name, place));
    if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
    return new Uint8Array(await answer.arrayBuffer());
  };
  const runtime = await factory({ locateFile: (name) => new URL(name, place).href });
  const { LiteRtEnvironment, LiteRtTensorBuffer, LiteRtTensorBufferType, LiteRtTensorBufferLockMode: lock } = runtime;
  const environment = LiteRtEnvironment.create(null);

  // The numbers of a tensor, which are moved when memory grows: to be looked at anew each time.
  function within(tensor, how, use) {
    const at = tensor.lock(how);
    const done = use(new Float32Array(runtime.HEAPU8.buffer, at, tensor.size() / 4));
    tensor.unlock();
    return done;
  }
  return Promise.all(names.map(async (name) => {
    const content = await read(name);
    const at = runtime._malloc(content.length); // the model reads there for as long as it lives
    runtime.HEAPU8.set(content, at);
    const model = runtime.loadModel(environment, at, content.length);
    const options = { environment, accelerator: "wasm", cpuOptions: { numThreads: 1 }, gpuOptions: {}, webNNOptions: {} };
    const compiled = await runtime.compileModel(environment, model, options);
    const type = model.getInputTensorType(0, 0);
    const input = LiteRtTensorBuffer.createManaged(environment, LiteRtTensorBufferType.HOST_MEMORY, type, type.bytes());
    return (numbers) => {
      within(input, lock.WRITE, (memory) => memory.set(numbers));
      return compiled.run(0, [input]).map((output) => {
        const values = within(output, lock.READ, (memory) => memory.slice());
        output.delete();
        return values;
      });
    };
  }));
}
