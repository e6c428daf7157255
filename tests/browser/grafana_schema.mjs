// Compares dashboards with the schema that Grafana itself is built with (@grafana/schema, generated from its CUE files):
// the TypeScript compiler judges each file's JSON as a Dashboard, and options and custom fields of each panel as those of
// its kind. Unknown keys are faults, too. usage: grafana_schema.mjs DASHBOARD.json...   a fault a line; exit 1 if any
import {readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import path from 'node:path';

const folder = process.env.VIBRIG_BROWSER_NPM;
const ts = createRequire(folder + '/')('typescript');
const kKinds = {stat: 'Stat', gauge: 'Gauge', bargauge: 'BarGauge', timeseries: 'TimeSeries', table: 'Table', text: 'Text', heatmap: 'Heatmap',
  'state-timeline': 'StateTimeline', 'status-history': 'StatusHistory', histogram: 'Histogram'};
// As JSON: an enumeration is one of its texts. What has a default may be missing in options.
const kTypes = `type Json<T> = T extends string ? \`\${T}\` : T extends object ? {[K in keyof T]: Json<T[K]>} : T;
type Partly<T> = T extends object ? {[K in keyof T]?: Partly<T[K]>} : T;\n`;

function source(dashboard) {
  const kinds = new Set(), panels = [];
  const all = (dashboard.panels || []).flatMap(p => [p, ...(p.panels || [])]);
  all.forEach((panel, i) => {
    if (!kKinds[panel.type]) return;
    kinds.add(panel.type);
    const name = kKinds[panel.type], custom = (panel.fieldConfig || {defaults: {}}).defaults.custom;
    if (panel.options) panels.push([panel, `export const options${i}: Partly<Json<${name}.Options>> = ${JSON.stringify(panel.options)};`]);
    if (custom) panels.push([panel, `export const custom${i}: Partly<Json<${name}.FieldConfig>> = ${JSON.stringify(custom)};`]);
  });
  const imports = [...kinds].map(kind => `import type * as ${kKinds[kind]} from './node_modules/@grafana/schema/dist/esm/raw/composable/${kind.replace('-', '')}/panelcfg/x/${kKinds[kind]}PanelCfg_types.gen';`);
  const head = [`import type {Dashboard} from '@grafana/schema';`, ...imports, kTypes].join('\n');
  return {panels, unknown: all.filter(p => !kKinds[p.type] && p.type !== 'row'), head: head + panels.map(([, line]) => line).join('\n') + '\n',
    whole: `export const dashboard: Json<Dashboard> = ${JSON.stringify(dashboard, null, 1)};\n`};
}

const options = {noEmit: true, strict: true, skipLibCheck: true, moduleResolution: ts.ModuleResolutionKind.Bundler, module: ts.ModuleKind.ES2022,
  target: ts.ScriptTarget.ES2022, types: []};
let faults = 0;
const say = words => { ++faults; console.log(words); };
const files = new Map();   // nothing is written: the texts lie in the package's folder by name alone
for (const file of process.argv.slice(2)) {
  const found = source(JSON.parse(readFileSync(file, 'utf8')));
  for (const panel of found.unknown) say(`${file}: panel "${panel.title}": type: found ${panel.type}, expected one of ${Object.keys(kKinds).join(', ')}`);
  files.set(path.join(folder, path.basename(file) + '.ts'), {file, ...found});
}
const host = ts.createCompilerHost(options), read = host.getSourceFile.bind(host), exists = host.fileExists.bind(host);
host.fileExists = name => files.has(name) || exists(name);
host.getSourceFile = (name, ...rest) => (files.has(name) ? ts.createSourceFile(name, files.get(name).head + files.get(name).whole, rest[0]) : read(name, ...rest));
for (const d of ts.getPreEmitDiagnostics(ts.createProgram([...files.keys()], options, host))) {
  const words = ts.flattenDiagnosticMessageText(d.messageText, ' '), found = d.file && files.get(d.file.fileName);
  if (!found) { say(words); continue; }
  const text = found.head + found.whole, line = text.slice(0, d.start).split('\n').length, before = found.head.split('\n').length;
  const place = line >= before ? `line ${line - before + 1} of its JSON: ${text.split('\n')[line - 1].trim().slice(0, 60)}`
    : (found.panels.find(([, p]) => p === text.split('\n')[line - 1]) || [{title: `line ${line}`}])[0].title;
  say(`${found.file}: ${place}: ${words}`);
}
if (faults === 0) console.log(`${files.size} dashboards as @grafana/schema has them`);
process.exitCode = faults ? 1 : 0;
