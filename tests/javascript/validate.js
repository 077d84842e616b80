// Prints what the Khronos validator says of glTF files, as JSON: a list of {errors, warnings, messages}.
const { validateBytes } = require("gltf-validator");
const { readFileSync } = require("fs");

Promise.all(process.argv.slice(2).map((path) => validateBytes(new Uint8Array(readFileSync(path))))).then((reports) => {
  const facts = reports.map(({ issues }) => ({
    errors: issues.numErrors, warnings: issues.numWarnings, messages: issues.messages.map(({ message }) => message),
  }));
  console.log(JSON.stringify(facts));
});
