// Reads GLB files with the reference validator; every error and warning is printed and ends in exit code 1.
const { readFileSync } = require('fs');
const { validateBytes } = require('gltf-validator');

for (const file of process.argv.slice(2)) {
  validateBytes(new Uint8Array(readFileSync(file))).then(({ issues }) => {
    for (const { severity, code, message, pointer } of issues.messages) {
      if (severity < 2) {
        console.log(`${file}: ${code} ${message} ${pointer}`);
      }
    }
    if (issues.numErrors + issues.numWarnings > 0) process.exitCode = 1;
  });
}
