// Opens HTML pages in headless Chromium and has axe-core look at them; every violation that is serious or critical is printed and
// ends in exit code 1. Usage: axe.js CHROMIUM FILE…
const { execFileSync } = require('child_process');
const { mkdtempSync, readFileSync, rmSync, writeFileSync } = require('fs');
const { tmpdir } = require('os');
const { join } = require('path');

const [chromium, ...files] = process.argv.slice(2);
const axe = readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8').replaceAll('</script', '<\\/script');
const look = `addEventListener('load', () => axe.run(document, { resultTypes: ['violations'] }).then(({ violations }) => {
  document.documentElement.innerHTML = '<pre id="found">' + encodeURIComponent(JSON.stringify(violations)) + '</pre>';
}));`;

for (const file of files) {
  const folder = mkdtempSync(join(tmpdir(), 'axe-'));
  const page = join(folder, 'page.html');
  const [before, after = ''] = readFileSync(file, 'utf8').split(/<\/body>/);
  writeFileSync(page, `${before}<script>${axe}</script><script>${look}</script></body>${after}`);
  const flags = ['--headless', '--no-sandbox', '--disable-gpu', `--user-data-dir=${join(folder, 'profile')}`, '--virtual-time-budget=20000', '--dump-dom'];
  const seen = execFileSync(chromium, [...flags, `file://${page}`], { encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'], maxBuffer: 1 << 28, timeout: 90000 });
  rmSync(folder, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  const found = seen.match(/<pre id="found">([^<]*)<\/pre>/);
  if (!found) throw new Error(`${file}: axe-core gave no answer`);
  for (const { id, impact, help, nodes } of JSON.parse(decodeURIComponent(found[1]))) {
    if (impact !== 'serious' && impact !== 'critical') continue;
    console.log(`${file}: ${id} (${impact}, ${nodes.length}): ${help}: ${nodes[0].html.slice(0, 120)}`);
    process.exitCode = 1;
  }
}
