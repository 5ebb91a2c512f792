// Validates GLBs with Khronos's validator and prints, for each, its errors, warnings and counts as JSON.

const fs = require("fs");
const validator = require("gltf-validator");

async function check(path) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { maxIssues: 0 });
  const messages = report.issues.messages.filter((issue) => issue.severity < 2).map((issue) => `${issue.pointer}: ${issue.message}`);
  return { errors: report.issues.numErrors, warnings: report.issues.numWarnings, messages, meshes: report.info.drawCallCount };
}

Promise.all(process.argv.slice(2).map(check)).then((found) => console.log(JSON.stringify(found)));
