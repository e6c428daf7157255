// Drives Chromium over the live page for a test: one JSON command a line on standard input, one JSON answer a line.
import {createInterface} from 'node:readline';
import {createRequire} from 'node:module';

const installed = createRequire(process.env.VIBRIG_BROWSER_NPM + '/');
const {chromium} = installed('playwright-core');
const axe = installed('axe-core');
const browser = await chromium.launch({executablePath: process.env.VIBRIG_CHROMIUM || '/usr/bin/chromium', headless: true,
  args: ['--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage']});
const errors = [];
let bytes = 0, page = null;
async function start(clientCertificates) {
  const context = await browser.newContext({viewport: {width: 1400, height: 1000}, ignoreHTTPSErrors: true, clientCertificates});
  page = await context.newPage();
  page.on('pageerror', error => errors.push(String(error)));
  page.on('console', message => { if (message.type() === 'error') errors.push(message.text()); });
  page.on('response', async response => { try { bytes += (await response.body()).length; } catch { /* a WebSocket */ } });
}
await start();

const commands = {
  async open({url}) { await page.goto(url, {waitUntil: 'load'}); return bytes; },
  async as({origin, certPath, keyPath}) { await page.context().close(); await start([{origin, certPath, keyPath}]); },   // another person
  async click({selector}) { await page.click(selector, {timeout: 10000}); },
  async drag({selector, from, to}) {   // shares of its width; without `to` the pointer rests there
    await page.locator(selector).scrollIntoViewIfNeeded();
    const box = await page.locator(selector).boundingBox(), y = box.y + box.height / 2;
    await page.mouse.move(box.x + from * box.width, y);
    if (to === undefined) return;
    await page.mouse.down();
    await page.mouse.move(box.x + (from + to) / 2 * box.width, y);
    await page.mouse.move(box.x + to * box.width, y);
    await page.mouse.up();
  },
  async text({selector}) { return (await page.textContent(selector)) ?? null; },
  async evaluate({script}) { return page.evaluate(script); },
  async until({script, timeout}) {   // waitForFunction() evaluates inside the page, which its policy forbids
    for (const end = Date.now() + timeout; Date.now() < end; await new Promise(done => setTimeout(done, 50))) {
      if (await page.evaluate(script)) return true;
    }
    return false;
  },
  async press({key}) { await page.keyboard.press(key); return page.evaluate(() => document.activeElement.id || document.activeElement.className); },
  async shot({file, width, height, scheme}) {
    await page.setViewportSize({width, height});
    await page.emulateMedia({colorScheme: scheme});
    await page.waitForTimeout(300);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    await page.screenshot({path: file, fullPage: true});
    return wide;
  },
  async names() {   // what has no name for a screen reader
    return page.evaluate(() => [...document.querySelectorAll('button, [role=img], section, progress, [tabindex="0"]')]
      .filter(e => !(e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') || e.textContent.trim()))
      .map(e => e.outerHTML.slice(0, 80)));
  },
  async axe({width, height, scheme}) {   // WCAG 2.2 AA as axe-core checks it: rule, how many, the first with its cause
    await page.setViewportSize({width, height});
    await page.emulateMedia({colorScheme: scheme});
    await page.waitForTimeout(300);
    await page.evaluate(axe.source);
    const tags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'];
    const found = await page.evaluate(tags => window.axe.run(document, {runOnly: tags}), tags);
    return {checked: found.passes.length, violations: found.violations.map(v =>
      `${v.id} (${v.nodes.length}): ${v.nodes[0].html.slice(0, 120)}: ${v.nodes[0].failureSummary}`.replace(/\s+/g, ' '))};
  },
  async errors() { return errors; },
};

for await (const line of createInterface({input: process.stdin})) {
  const command = JSON.parse(line);
  let answer;
  try { answer = {value: await commands[command.command](command)}; } catch (error) { answer = {error: String(error)}; }
  process.stdout.write(JSON.stringify(answer) + '\n');
}
await browser.close();
