'use strict';
// Charts, the gimbals' picture and the table of coefficients. No state but what is drawn.
const Draw = (() => {
  const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const byId = id => document.getElementById(id);
  const charts = new Map(), watched = new Set();
  const sizes = new ResizeObserver(() => resize());   // the room of a chart is what the tables beside it leave

  function options(element, name) {
    const axis = {space: 20, stroke: css('--soft'), grid: {stroke: css('--line'), width: 1}, ticks: {stroke: css('--line')}, font: '12px system-ui'};
    const line = (k, extra) => ({stroke: css('--c' + k), width: 2, points: {show: false}, ...extra});
    const cursor = {y: false, points: {size: 6}, drag: {x: true, y: false}, ...(name === 'allan' || name === 'psd' ? {} : {sync: {key: 'min', filters: {pub: hovers, sub: hovers}}})};
    const sized = {width: element.clientWidth || 300, height: element.clientHeight || 200, cursor, legend: {show: false},
      hooks: {setScale: [(u, key) => { if (key === 'x') element.dataset.from = u.scales.x.min; }], setCursor: [read], setSelect: [u => { u.zoomed = u.select.width > 0; }]}};
    const minutes = {...axis, space: 50, size: 24, values: (u, v) => v.map((x, i) => (i + 1 < v.length ? String(x) : x + ' min'))};
    const none = {stroke: 'transparent', points: {show: false}};
    // Whole decades; where there are less than two of them, 2 and 5 too.
    const marked = (scale, v) => v.map(x => {
      const whole = 10 ** Math.floor(Math.log10(x) + 1e-9), first = Math.round(x / whole);
      return x !== null && (first === 1 || (scale.max / scale.min < 30 && (first === 2 || first === 5))) ? String(+x.toPrecision(2)) : '';
    });
    const decades = (u, v) => v.map(x => (x !== null && Math.abs(Math.log10(x) - Math.round(Math.log10(x))) < 1e-9 ? x : null));
    const grid = {...axis.grid, filter: decades}, ticks = {...axis.ticks, filter: decades};
    const log = {...axis, grid, ticks, size: 54, filter: (u, v) => v, values: (u, v) => marked(u.scales.y, v)};
    switch (name) {
      case 'amplitude': return {...sized, scales: {x: {time: false}, y: {range: (u, lo, hi) => [0, Math.max(1, hi * 1.05)]}},
        axes: [minutes, {...axis, size: 40}],
        series: [{label: 'min'}, none, none, none, none, line(1, {dash: [6, 4], label: 'commanded, g'}), line(2, {dash: [2, 3], label: 'set point read back, g'}), line(0, {label: 'measured, g'})],
        bands: [{series: [2, 1], fill: css('--alarm')}, {series: [4, 3], fill: css('--abort')}]};
      case 'temperature': return {...sized, scales: {x: {time: false}, y: {range: (u, lo, hi) => [Math.min(lo, (lo + hi) / 2 - .5), Math.max(hi, (lo + hi) / 2 + .5)]}},
        axes: [minutes, {...axis, size: 54}], series: [{label: 'min'}, line(0, {label: '°C'})]};
      case 'residuals': return {...sized, scales: {x: {time: false}, y: {range: (u, lo, hi) => { const most = lo === null ? 1 : Math.max(Math.abs(lo), Math.abs(hi), 1e-4) * 1.1; return [-most, most]; }}},
        axes: [minutes, {...axis, size: 58, values: (u, v) => v.map(x => String(+x.toPrecision(3)))}], series: [{label: 'min'}, ...['x', 'y', 'z'].map((g, k) => ({...dots(k), label: g + ', deg/h'}))]};
      case 'innovations': return {...sized, scales: {x: {time: false}}, axes: [minutes, {...axis, size: 44}],
        series: [{label: 'min'}, ...['x', 'y', 'z'].map((a, k) => line(k, {width: 1, label: a + ', arcsec'}))]};
      case 'sigma': return {...sized, scales: {x: {time: false}, y: {distr: 3, range: (u, lo, hi) => [Math.min(lo || 1, .5), Math.max(hi || 10, 2)]}},
        axes: [minutes, log], series: [{label: 'min'}, ...['bias', 'linear', 'quadratic'].map((kind, k) => line(k, {label: kind})), {stroke: css('--soft'), dash: [3, 4], points: {show: false}}]};
      case 'psd': return {...sized, scales: {x: {time: false, distr: 3}, y: {distr: 3, range: (u, lo, hi) => [(lo || 1e-3) / 2, (hi || 1e-3) * 2]}},
        axes: [{...axis, grid, ticks, size: 24, filter: (u, v) => v, values: (u, v) => marked(u.scales.x, v).map(x => x && x + ' Hz')}, log], series: [{label: 'Hz'}, line(0, {label: 'PSD, g²/Hz'})]};
      default: return {...sized, scales: {x: {time: false, distr: 3}, y: {distr: 3}},
        axes: [{...axis, grid, ticks, size: 24, filter: (u, v) => v, values: (u, v) => marked(u.scales.x, v).map(x => x && x + ' s')}, log],
        series: [{label: 's'}, ...['x', 'y', 'z'].map((g, k) => line(k, {label: g + ' expected, deg/h'})), ...['x', 'y', 'z'].map((g, k) => ({...dots(k), label: g + ' measured'})), ...['x', 'y', 'z'].map((g, k) => line(k, {width: 1, dash: [2, 4], label: g + ' classical, deg/h'}))]};
    }
  }
  const hovers = kind => kind === 'mousemove' || kind === 'mouseleave';   // what charts of one time share; zoom is each one's own
  // What is under the cursor, in words, above the chart.
  function read(u) {
    const note = u.root.querySelector('.read'), i = u.cursor.idx;
    if (!note) return;
    const known = i === null || i === undefined ? [] : u.series.slice(1).map((s, k) => [s.label, u.data[k + 1][i]]).filter(([label, y]) => label !== 'Value' && y !== null && y !== undefined);
    note.hidden = known.length === 0;
    note.textContent = known.length ? `${+u.data[0][i].toPrecision(4)} ${u.series[0].label}: ` + known.map(([label, y]) => {
      const [name, unit] = label.split(', ');
      return unit ? `${name} ${+y.toPrecision(4)} ${unit}` : label === '°C' ? `${+y.toPrecision(5)} °C` : `${label} ${+y.toPrecision(3)}`;
    }).join(', ') : '';
  }
  const dots = k => ({stroke: css('--c' + k), paths: () => null, points: {show: true, size: 8, fill: css('--c' + k)}});

  function chart(name, data) {
    const element = byId('c-' + name);
    let plot = charts.get(name);
    if (!plot) {
      element.textContent = '';
      plot = new uPlot(options(element, name), data, element);
      plot.root.append(Object.assign(document.createElement('p'), {className: 'read', hidden: true}));
      plot.over.title = 'Drag to zoom, double-click for all';
      charts.set(name, plot);
      if (!watched.has(element)) { watched.add(element); sizes.observe(element); }
    } else {
      plot.setData(data, !plot.zoomed);   // who looks at a part keeps it
      if (plot.zoomed) plot.redraw();
    }
  }

  // A column for each dwell; below its alarm gyros x, y, z, each with its averaging times: what is above the expected is red.
  function surface(curves, expected) {
    const canvas = byId('surface'), taus = [...new Set(curves.flatMap(c => c.tau_s))].sort((a, b) => a - b);
    canvas.width = Math.max(1, curves.length);
    canvas.height = 3 * taus.length + 3;
    const g = canvas.getContext('2d');
    const cell = (x, y, name, alpha) => { g.globalAlpha = alpha; g.fillStyle = css(name); g.fillRect(x, y, 1, 1); };
    curves.forEach((curve, column) => {
      if (curve.alarm) cell(column, 0, '--bad', 1);
      ['x', 'y', 'z'].forEach((gyro, j) => curve.tau_s.forEach((tau, i) => {
        const doublings = Math.log2(curve[gyro + '_deg_h'][i] / expected(j, tau));
        if (Number.isFinite(doublings)) cell(column, 1 + j * (taus.length + 1) + taus.indexOf(tau), doublings > 0 ? '--bad' : '--c0', Math.min(1, Math.abs(doublings)));
      }));
    });
    const alarms = curves.filter(c => c.alarm).map(c => `run ${c.run} position ${c.position}`);
    const words = `Dwells one by one: ${curves.length || 'none yet'}; gyros x, y, z, averaging time downwards, red above and blue below what the noise lets expect; `
      + (alarms.length ? 'alarms in ' + alarms.join(', ') : 'no alarm');
    canvas.setAttribute('aria-label', words);
    canvas.title = words;
    canvas.dataset.dwells = curves.length;
  }

  function again() {
    for (const plot of charts.values()) plot.destroy();
    charts.clear();
  }
  function resize() {
    for (const [name, plot] of charts) {
      const element = byId('c-' + name);
      if (element.clientWidth && (plot.width !== element.clientWidth || plot.height !== element.clientHeight))
        plot.setSize({width: element.clientWidth, height: element.clientHeight});
    }
  }

  // Reference axes: x north, y up, z east; reference to platform is Rz(azimuth) Ry(inner) Rx(outer), so
  // the way back turns by the negative angles.
  const turn = (i, j) => (v, deg) => {
    const r = deg * Math.PI / 180, c = Math.cos(r), s = Math.sin(r), w = v.slice();
    w[i] = c * v[i] - s * v[j];
    w[j] = s * v[i] + c * v[j];
    return w;
  };
  const back = f => (v, deg) => f(v, -deg);
  const ry0 = turn(2, 0), rx = back(turn(1, 2)), ry = back(ry0), rz = back(turn(0, 1));

  // The platform axis that points up at zero angles, as "+y"; north is the axis before it, east the one after.
  const axisOf = name => ['xyz'.indexOf(name[1]), name[0] === '-' ? -1 : 1];
  const toReference = ([a, b, g], v) => rx(ry(rz(v, g), b), a);
  const up = (deg, v, name) => { const [k, sign] = axisOf(name); return sign * toReference(deg, v)[k]; };

  // `name`: what points up. Returns the cosine between force and vertical.
  function gimbals(deg, force, words, name) {
    const [a, b] = deg, [k, sign] = axisOf(name);
    const placed = v => toReference(deg, v);
    // North, up, east, seen from the south-east, a little from above.
    const screen = v => {
      const w = ry0([v[(k + 2) % 3], sign * v[k], sign * v[(k + 1) % 3]], -28), down = 18 * Math.PI / 180;
      return [w[0] * 100, -(w[1] * Math.cos(down) + w[2] * -Math.sin(down)) * 100];
    };
    const path = points => 'M' + points.map(p => screen(p).map(n => n.toFixed(1)).join(' ')).join('L');
    const ring = (radius, u, v) => path(Array.from({length: 49}, (_, k) => {
      const t = k * Math.PI / 24;
      return [0, 1, 2].map(i => radius * (Math.cos(t) * u[i] + Math.sin(t) * v[i]));
    }));
    const outer = v => rx(v, a), inner = v => rx(ry(v, b), a);
    const line = (v, from = 0) => path([v.map(n => n * from), v]);
    const parts = [
      `<path d="${line([0, 1, 2].map(i => (i === k ? sign : 0)), -1)}" stroke="var(--soft)" stroke-dasharray="3 3"/>`,
      `<path d="${ring(.95, outer([1, 0, 0]), outer([0, 1, 0]))}" stroke="var(--c0)" stroke-width="3"/>`,
      `<path d="${ring(.78, inner([0, 1, 0]), inner([0, 0, 1]))}" stroke="var(--c1)" stroke-width="3"/>`,
      `<path d="${ring(.6, placed([1, 0, 0]), placed([0, 1, 0]))}Z" stroke="var(--c2)" stroke-width="3" fill="var(--c2)" fill-opacity=".15"/>`];
    ['x', 'y', 'z'].forEach((letter, i) => {
      const axis = placed([0, 1, 2].map(n => (n === i ? .6 : 0)));
      const [x, y] = screen(axis.map(n => n * 1.15));
      parts.push(`<path d="${line(axis)}" stroke="var(--c2)" stroke-width="1.5"/><text x="${x.toFixed(1)}" y="${y.toFixed(1)}" fill="var(--ink)" font-size="9" text-anchor="middle">${letter}</text>`);
    });
    if (force) {
      const tip = placed(force), [x, y] = screen(tip);
      parts.push(`<path d="${line(tip)}" stroke="var(--bad)" stroke-width="3"/><circle cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="4" fill="var(--bad)"/>`);
    }
    const picture = byId('gimbals');
    picture.innerHTML = `<g fill="none" stroke-linejoin="round">${parts.join('')}</g>`;
    picture.setAttribute('aria-label', words);
    return force ? up(deg, force, name) : null;
  }

  const digits = (value, sigma) => {
    const decimals = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(sigma || 1e-3))));
    return value.toFixed(decimals);
  };

  let cells = null;
  // Digits as its uncertainty has them.
  const before = c => { const half = (c.interval[1] - c.interval[0]) / 2; return `<br><small class="earlier">${digits(c.mean, half)} ± ${half.toPrecision(2)}</small>`; };
  function coefficients(parameters, targets, earlier = {}) {
    const table = byId('coefficients');
    if (!cells || cells.length !== parameters.length) {
      const rows = parameters.length / 3;
      let html = '<thead><tr><td></td><th scope="col">gyro x</th><th scope="col">gyro y</th><th scope="col">gyro z</th><th scope="col" class="unit">unit</th></tr></thead><tbody>';
      for (let r = 0; r < rows; ++r) {
        html += `<tr><th scope="row">${parameters[r].name.replace(/[xyz]$/, '')}</th>` + '<td></td>'.repeat(3) + `<th class="unit">${parameters[r].unit.replace('^2', '²')}</th></tr>`;
      }
      table.innerHTML = html + '</tbody>';
      const found = [...table.querySelectorAll('tbody td')];
      cells = parameters.map((p, i) => found[(i % rows) * 3 + Math.floor(i / rows)]);
    }
    parameters.forEach((p, i) => {
      const past = earlier[p.name] ? before(earlier[p.name]) : '';
      if (p.value === undefined || p.sigma === undefined) { cells[i].innerHTML = '–' + past; return; }
      const target = targets[p.name], factor = target ? p.sigma / target : NaN;
      const decades = Math.log10(factor);
      const width = Number.isFinite(decades) ? Math.min(100, Math.max(2, decades * 25)) : 0;
      const met = factor <= 1.02;
      cells[i].innerHTML = `${digits(p.value, p.sigma)} <small>± ${p.sigma.toPrecision(2)}</small>${past}` +
        `<svg preserveAspectRatio="none" viewBox="0 0 100 4" role="img" aria-label="${Number.isFinite(factor) ? `sigma ${factor.toFixed(1)} times its target` : 'no target'}"><rect class="${met ? 'met' : 'over'}" width="${width}" height="4"/></svg>`;
    });
  }

  return {surface, chart, again, resize, up, gimbals, coefficients, digits, byId};
})();
