'use strict';
// Follows /api/v1/stream and shows what it says; loud when it says nothing.
(() => {
  const {byId} = Draw, {duration} = Watch;
  const kKept = 2400, kStale_ms = 4000, kRate_hz = 2, kHidden_hz = 0.2, kEvents = 300;
  let direction = null, status = null, plan = null, targets = {}, role = 'viewer', instance = '', lastEvent = 0;
  let known = '';   // whose history is here
  let caughtUp = false;   // what happened before one came makes no noise
  let heard = performance.now(), socket = null, pause = 500, failing = false;
  const history = {t: [], rows: []};

  const number = x => (x === undefined ? NaN : Number(x));
  const fixed = (x, n, unit) => (Number.isFinite(number(x)) ? number(x).toFixed(n) + ' ' + unit : '– ' + unit);
  function set(id, text) { const e = byId(id); if (e.textContent !== text) e.textContent = text; }

  function merge(target, patch) {   // RFC 7396
    for (const [key, value] of Object.entries(patch)) {
      if (value === null) delete target[key];
      else if (typeof value === 'object' && !Array.isArray(value)) {
        const inside = target[key] && typeof target[key] === 'object' && !Array.isArray(target[key]) ? target[key] : {};
        target[key] = merge(inside, value);
      } else target[key] = value;
    }
    return target;
  }

  // ---- what is drawn of a status
  function list(id, items) {
    const e = byId(id);
    while (e.children.length > items.length) e.lastChild.remove();
    items.forEach(([kind, left, right], i) => {
      let li = e.children[i];
      if (!li) {
        li = document.createElement('li');
        li.append(document.createElement('span'), document.createElement('span'));
        e.append(li);
      }
      if (li.className !== kind) li.className = kind;
      if (li.firstChild.textContent !== left) li.firstChild.textContent = left;
      if (li.lastChild.textContent !== right) li.lastChild.textContent = right;
    });
  }
  function table(id, items) {
    const e = byId(id);
    if (e.children.length !== 2 * items.length) {
      e.textContent = '';
      for (const [name] of items) {
        const dt = document.createElement('dt');
        dt.textContent = name;
        e.append(dt, document.createElement('dd'));
      }
    }
    items.forEach(([name, text, bad], i) => {
      const dt = e.children[2 * i], dd = e.children[2 * i + 1];
      if (dt.textContent !== name) dt.textContent = name;
      if (dd.textContent !== text) dd.textContent = text;
      dd.className = bad ? 'bad-value' : '';
    });
  }

  const kBad = ['tripped', 'aborted'], kCalm = ['idle', 'finished', 'unspecified'];
  function head(s) {
    const c = s.campaign;
    set('state', c.state);
    set('reason', c.reason || (c.resume_offer ? 'to be resumed: ' + c.resume_offer : ''));
    set('verdict', s.verdict ? `${s.verdict.dwells} dwells: ${s.verdict.sentence}` : '');
    byId('verdict').title = s.verdict ? s.verdict.sentence : '';
    set('campaign', c.name + (c.armed_by ? ', armed by ' + c.armed_by : ', not armed'));
    document.querySelector('header').className = kBad.includes(c.state) ? 'bad' : kCalm.includes(c.state) ? 'good' : 'active';
    const done = 100 * (c.progress || 0), broken = kBad.includes(c.state);
    const commissioned = c.state === 'commissioning';   // no campaign: its steps have no share of a whole
    document.title = `${c.state.toUpperCase()}${commissioned ? '' : ` ${done.toFixed(0)} %`} – ${c.name}`;
    set('position', commissioned ? (/step [^;]*/.exec(c.reason) || ['first look'])[0] : c.run > 0 ? `run ${c.run}/${c.runs}, position ${c.position}/${c.positions}` : 'no position');
    set('left', commissioned ? '' : `${done.toFixed(1)} %` + (broken ? ', interrupted' : c.remaining_s > 0 ? `, ${duration(c.remaining_s)} left` : ''));
    byId('progress').value = done;
    stops(c, broken);
  }
  function stops(c, broken) {
    const e = byId('stops'), all = plan && c.state !== 'commissioning' ? plan.stops : [];
    const dwells = new Map((c.dwells || []).map(d => [d.run + '/' + d.position, d]));
    const key = JSON.stringify([all.length, [...dwells].map(([k, d]) => k + d.flagged), c.run, c.position, broken]);
    if (e.dataset.key === key) return;
    e.dataset.key = key;
    e.textContent = '';
    let run = 0;
    for (const stop of all) {
      if (stop.run !== run) {
        const li = document.createElement('li');
        li.className = 'run';
        li.textContent = `run ${run = stop.run}, ${+stop.table_g.toPrecision(4)} g`;
        e.append(li);
      }
      const li = document.createElement('li'), dwell = dwells.get(stop.run + '/' + stop.position);
      const now = stop.run === c.run && stop.position === c.position;
      const cut = now && broken;   // what it recorded before is no position done
      li.className = (cut ? 'cut' : dwell ? (dwell.flagged ? 'flagged' : 'done') : '') + (now ? ' now' : '');
      li.textContent = stop.position;
      const a = stop.angles;
      li.title = `${a.outer_deg}, ${a.inner_deg}, ${a.azimuth_deg} deg` + (dwell && dwell.flagged ? ': ' + dwell.reason : '');
      li.setAttribute('aria-label', `position ${stop.position}${cut ? ', interrupted' : dwell ? (dwell.flagged ? ', flagged' : ', done') : ''}${now && !cut ? ', now' : ''}`);
      e.append(li);
    }
  }

  function channel(s, name) { return (s.sample.channels || []).find(c => c.name === name) || {}; }
  const turned = deg => deg - 360 * Math.round(deg / 360);
  function gimbals(s) {
    const names = ['outer', 'inner', 'azimuth'];
    const raw = names.map(n => channel(s, n).value), read = ['accel_x', 'accel_y', 'accel_z'].map(n => channel(s, n).value);
    // As the configuration has it: gimbal angle = sign (encoder - zero), force in platform axes = matrix (reading - zero).
    const f = s.frame, deg = raw.map((r, i) => (r === undefined ? r : turned(f.encoder_sign[i] * (r - f.encoder_zero_deg[i]))));
    const good = read.every(r => r !== undefined);
    const force = [0, 1, 2].map(i => read.reduce((sum, r, j) => sum + f.accelerometer_matrix[3 * i + j] * (r - f.accelerometer_zero_g[j]), 0));
    const shown = deg.map(d => d || 0), size = good ? Math.hypot(...force) : NaN;
    const words = `Gimbals: ${names.map((n, i) => `${n} ${fixed(deg[i], 1, 'degrees')}`).join(', ')}; the red line is the measured specific force, the dashed one the vertical`;
    // Under vibration gravity and acceleration lie on one line, whichever is greater at the moment.
    if (good && size > 0.3) direction = force.map(x => x / size);
    if (direction && Draw.up(shown, direction, f.up) < 0) direction = direction.map(x => -x);
    const cosine = Draw.gimbals(shown, good ? direction : null, words, f.up);
    const off = cosine === null ? NaN : Math.acos(Math.max(-1, Math.min(1, cosine))) * 180 / Math.PI;
    const encoder = i => (Math.abs(deg[i] - raw[i]) > 1e-9 ? ` (encoder ${raw[i].toFixed(3)})` : '');
    table('angles', [...names.map((n, i) => [n, deg[i] === undefined ? 'not good' : fixed(deg[i], 3, '°') + encoder(i), deg[i] === undefined]),
      ['specific force', fixed(size, 3, 'g'), !good], ['off the vertical', fixed(off, 1, '°'), false],
      ['platform', !s.platform || s.platform.ready === undefined ? (s.platform && s.platform.quality === 'silent' ? 'silent' : 'no status') : (s.platform.ready ? 'ready' : 'not ready') + (s.platform.temperature_c === undefined ? '' : `, ${s.platform.temperature_c.toFixed(2)} °C`),
        !(s.platform && s.platform.ready)]]);
  }

  function remember(s) {
    const t = s.time_s, last = history.t[history.t.length - 1];
    if (last !== undefined && t < last) { history.t = []; history.rows = []; }   // another daemon
    if (t === last) return;
    const rows = (s.interlock.rows || []).filter(r => r.condition === 'amplitude_off_command' && r.limit !== undefined);
    const command = s.campaign.state === 'idle' ? 0 : s.campaign.command_table_g || 0;
    const band = reaction => {
      const row = rows.find(r => r.reaction === reaction);
      return row && command > 0 ? [command * 10 ** (-row.limit / 20), command * 10 ** (row.limit / 20)] : [null, null];
    };
    const worst = [0, 0, 0], kinds = ['deg/h', 'deg/h/g', 'deg/h/g^2'];
    for (const p of s.estimate.parameters || []) {
      if (p.sigma === undefined || !targets[p.name]) continue;
      const k = kinds.indexOf(p.unit);
      worst[k] = Math.max(worst[k], p.sigma / targets[p.name]);
    }
    const v = s.estimate.innovation || {}, n = x => (x === undefined ? null : x);
    history.t.push(t);
    history.rows.push([...band('alarm'), ...band('abort'), command, n(s.shaker.measured_g),
      n(v.x_arcsec), n(v.y_arcsec), n(v.z_arcsec), ...worst.map(w => w || null), n((s.platform || {}).temperature_c), n(s.shaker.amplitude_g)]);
    if (history.t.length > kKept) {   // every other one of the older half: the beginning stays
      const thin = list => list.filter((_, i) => i > kKept / 2 || i % 2 === 0);
      history.t = thin(history.t);
      history.rows = thin(history.rows);
    }
  }
  // What was before this page came: means of the steps, and of the innovations what was farthest from zero.
  const kHistory = ['measured_g', 'command_g', 'innovation_x_arcsec', 'innovation_y_arcsec', 'innovation_z_arcsec',
    'sigma_over_target_bias', 'sigma_over_target_linear', 'sigma_over_target_quadratic', 'temperature_c', 'set_point_g'];
  async function getHistory() {
    try {
      const past = await (await fetch('/api/v1/history?channel=' + kHistory.join(','))).json();
      const [measured, command, x, y, z, bias, linear, quadratic, temperature, point] = past.channels;
      const farthest = c => c.max.map((most, i) => (most === null ? null : most > -c.min[i] ? most : c.min[i]));
      const around = [x, y, z].map(farthest), rows = (status && status.interlock.rows || []).filter(r => r.condition === 'amplitude_off_command' && r.limit !== undefined);
      const factor = reaction => { const row = rows.find(r => r.reaction === reaction); return row ? 10 ** (row.limit / 20) : null; };
      const old = past.time_s.map((t, i) => [t, [...['alarm', 'abort'].flatMap(reaction => {
        const f = factor(reaction), g = command.min[i];
        return f && g > 0 ? [g / f, g * f] : [null, null];
      }), command.mean[i], measured.mean[i], ...around.map(a => a[i]), ...[bias, linear, quadratic].map(c => c.mean[i] || null), temperature.mean[i], point.mean[i]]])
        .filter(([t]) => history.t.length === 0 || t < history.t[0]);
      history.t.unshift(...old.map(([t]) => t));
      history.rows.unshift(...old.map(([, row]) => row));
      byId('c-amplitude').dataset.past = old.length;
      show();
    } catch { /* the stream tells when the link is lost */ }
  }
  // What the archive has of this unit; a campaign that was delivered is part of it.
  let seenDelivered = null, earlier = {};
  async function getEarlier(s) {
    const delivered = s.archive ? String(s.archive.delivered) : null;
    if (seenDelivered === delivered) return;
    seenDelivered = delivered;
    try {
      const unit = await (await fetch('/api/v1/unit')).json();
      earlier = Object.fromEntries(unit.coefficients.map(c => [c.name, c]));
      const last = unit.campaigns.at(-1), note = byId('earlier-note');
      note.hidden = !last;
      if (last) note.textContent = `Below each: unit ${unit.unit.serial} before, mean of ${unit.campaigns.length} campaigns with its 95 % interval; the newest ${last.started}, ${last.verdict || 'without a verdict'}${unit.vibration ? `; ${unit.vibration}` : ''}.`;
    } catch { seenDelivered = undefined; }   // asked again with the next status
  }
  let seenDwells = null, classical = [new Map(), new Map(), new Map()];
  async function getSurface(expected) {
    try {
      const curves = (await (await fetch('/api/v1/surface')).json()).curves || [];
      classical = ['x', 'y', 'z'].map(gyro => meanSquare(curves, gyro + '_classical_deg_h'));
      Draw.surface(curves, expected);
    } catch { seenDwells = null; }   // asked again with the next status
  }
  // By averaging time, over the dwells.
  function meanSquare(curves, key) {
    const sums = new Map();
    for (const c of curves) {
      c.tau_s.forEach((tau, i) => {
        const s = sums.get(tau) || [0, 0];
        sums.set(tau, [s[0] + c[key][i] ** 2, s[1] + 1]);
      });
    }
    return new Map([...sums].map(([tau, [sum, n]]) => [tau, Math.sqrt(sum / n)]));
  }
  const column = k => history.rows.map(r => r[k]);
  function charts(s) {
    if (history.t.length === 0) return;
    const start = history.t[0], t = history.t.map(s => (s - start) / 60);
    Draw.chart('amplitude', [t, ...[0, 1, 2, 3, 4, 13, 5].map(column)]);
    Draw.chart('innovations', [t, ...[6, 7, 8].map(column)]);
    Draw.chart('sigma', [t, ...[9, 10, 11].map(column), t.map(() => 1)]);
    Draw.chart('temperature', [t, column(12)]);
    const left = (s.verdict && s.verdict.residuals) || [], axes = ['x', 'y', 'z'];
    Draw.chart('residuals', [left.map(d => 60 * d.time_h), ...axes.map(a => left.map(d => d[a + '_deg_h']))]);
    const scatter = axes.map(a => Math.sqrt(left.reduce((sum, d) => sum + (d[a + '_deg_h'] / d[a + '_sigma_deg_h']) ** 2, 0) / left.length));
    const words = left.length ? `rms/σ ${scatter.map(x => x.toFixed(2)).join(', ')}` : 'too few yet';
    byId('c-residuals').dataset.points = left.length;
    set('residual-note', '   ' + words);
    byId('c-residuals').setAttribute('aria-label', `Residual drift of ${left.length} dwells, ${words}`);
    const e = s.estimate, c = s.campaign;
    set('amplitude', fixed(s.shaker.measured_g, 3, 'g'));
    const random = (s.vibration || {}).kind === 'random';
    set('command', `commanded ${fixed(c.command_table_g, 2, 'g')}${random ? ' rms, at random' : (s.vibration || {}).kind === 'sweep' ? `, ${s.vibration.words}` : `, ${fixed(s.shaker.frequency_hz, 2, 'Hz')}`}`);
    byId('c-amplitude').setAttribute('aria-label', `Table amplitude ${fixed(s.shaker.measured_g, 3, 'g')}, commanded ${fixed(c.command_table_g, 2, 'g')}, since ${duration(s.time_s - start)}`);
    set('nis', e.nis_per_dof === undefined ? '' : `   NIS ${e.nis_per_dof.toFixed(3)}`);
    byId('c-innovations').setAttribute('aria-label', `Innovations ${['x', 'y', 'z'].map(a => fixed((e.innovation || {})[a + '_arcsec'], 1, 'arc seconds')).join(', ')}`);
    const worst = history.rows[history.rows.length - 1].slice(9, 12);
    byId('c-sigma').setAttribute('aria-label', `Largest sigma over target: bias ${worst[0] || 'unknown'}, linear ${worst[1] || 'unknown'}, quadratic ${worst[2] || 'unknown'}`);
    allan(s);
  }
  // Points: modified Allan deviation of the dwells' residuals. Lines: what the identified noise lets expect; before the
  // first dwell the configured random walk N / sqrt(2 tau).
  function allan(s) {
    const noise = s.noise || {}, gyros = noise.gyros || [];
    if (gyros.length < 3) return;
    const points = gyros.map(g => new Map((g.points || []).map(p => [p.tau_s, p])));
    const measured = [...new Set(points.flatMap(m => [...m.keys()]))].sort((a, b) => a - b);
    const taus = measured.length ? measured : [2, 4, 8, 16, 32];
    const at = (m, tau, key) => { const p = m.get(tau); return p && p[key] > 0 ? p[key] : null; };
    const lines = gyros.map((g, i) => taus.map(tau => (measured.length ? at(points[i], tau, 'expected_deg_h')
      : g.in_force_deg_per_rt_h ? g.in_force_deg_per_rt_h / Math.sqrt(2 * tau / 3600) : null)));
    Draw.chart('allan', [taus, ...lines, ...points.map(m => taus.map(tau => at(m, tau, 'deviation_deg_h'))),
      ...classical.map(m => taus.map(tau => m.get(tau) || null))]);
    const dwells = `${instance} ${noise.dwells} ${noise.dwells_left_out}`;
    if (seenDwells !== dwells) {
      seenDwells = dwells;
      getSurface((j, tau) => at(points[j], tau, 'expected_deg_h'));
    }
    const words = gyros.map(g => {
      const n = g.fit && g.fit.N;
      return `${g.gyro} ${n && n.value !== undefined ? n.value.toExponential(1) : 'N as configured'}`;
    }).join(', ');
    set('noise', noise.dwells ? `   points measured, lines identified, dashed the classical deviation within a dwell; N, deg/√h, from ${noise.dwells} dwells: ${words}` : '   as configured; no dwell yet');
    const chart = byId('c-allan');
    chart.dataset.points = points.reduce((n, m) => n + m.size, 0);
    chart.dataset.classical = classical.reduce((n, m) => n + m.size, 0);
    chart.setAttribute('aria-label', `Modified Allan deviation of the residuals, ${chart.dataset.points} points measured. ${words}`);
  }

  function latency(l) {
    const n = l.counts.reduce((sum, c) => sum + Number(c), 0);
    return n ? `${(l.sum_ms / n).toFixed(3)} ms, worst ${l.largest_ms.toFixed(2)} ms` : 'not on this clock';
  }
  function health(s) {
    list('channels', (s.clock_misfit ? [['bad', 'clock', s.clock_misfit]] : []).concat((s.sample.channels || []).map(c => {
      const kind = c.quality === 'unbound' ? 'off' : c.quality !== 'good' || c.age_s > 1 ? 'bad' : c.age_s > 0.2 ? 'warn' : '';
      return [kind, Watch.person(c.name), [...(c.quality === 'good' ? [] : [c.quality]), ...(c.value === undefined ? [] : [`${c.value.toFixed(4)} ${c.unit}`]),
        ...(c.age_s === undefined ? [] : [`${c.age_s.toFixed(2)} s ago`])].join(', ')];
    })));
    const i = s.interlock, stopped = (i.reaction_counts || []).reduce((n, c) => n + Number(c), 0), lines = Watch.lines(s);
    const line = (name, head, bad) => {   // what the code knows of it, then its single values
      const values = lines.get(name) || {text: '', bad: false};
      lines.delete(name);
      return [name, [head, values.text].filter(x => x).join(', '), bad || values.bad];
    };
    const about = line('daemon', '', false)[1];
    table('links', [
      line('CAN', s.can.link, s.can.link !== 'running'), line('shaker', s.shaker.link, s.shaker.link !== 'running'),
      ['rest', (s.shaker.rest || 'unknown') + (s.shaker.rest === 'stop not obeyed' ? ': PRESS THE EMERGENCY STOP' : ''), s.shaker.stop_pending || s.shaker.rest === 'stop not obeyed'],
      ['emergency stop', s.shaker.emergency_stop_open === undefined ? 'not read' : s.shaker.emergency_stop_open ? 'OPEN' : 'closed', s.shaker.emergency_stop_open !== false],
      ['journal', s.journal.path ? (s.journal.running ? 'writes' : 'WAITS: ' + s.journal.note) : 'none', s.journal.path && !s.journal.running],
      line('samples', '', false), line('dropped', '', false), ['frame to ring', latency(s.acquisition_latency)],
      ...(s.mqtt.broker ? [['broker', s.mqtt.connected ? 'connected' : 'DOWN: ' + s.mqtt.note, !s.mqtt.connected]] : []),
      ['stops', `${stopped}, slowest ${number(i.reaction_largest_ms || 0).toFixed(2)} ms`],
      ...[...lines].map(([name, values]) => [name, values.text, values.bad])]);
    set('footer', `${about}; you are ${/^[ao]/.test(role) ? "an" : "a"} ${role}`);
  }

  // What shakes: kind, frequency or profile, and how much of it by command, controller and accelerometers.
  function vibration(s) {
    const v = s.vibration, card = byId('vibration-card');
    card.hidden = !v;
    if (!v) return;
    const random = v.kind === 'random', unit = random ? ' g rms' : ' g peak', rows = s.interlock.rows || [];
    const off = rows.find(r => r.condition === 'amplitude_off_command' && r.reaction === 'abort' && r.limit !== undefined);
    const low = random ? v.low_g : off && v.commanded_g * 10 ** (-off.limit / 20), high = random ? v.high_g : off && v.commanded_g * 10 ** (off.limit / 20);
    const steady = s.campaign.state === 'recording';
    const seen = (name, x) => (x === undefined ? [name, 'not known', false]
      : [name, x.toFixed(3) + unit, steady && low !== undefined && (x < low || x > high)]);
    table('vibration', [['kind', v.kind], ...(v.kind === 'rest' ? [] : [
      ...(random ? [['profile', `${v.profile || 'unknown'} (number ${v.number}), ${v.level_db.toFixed(1)} dB`], ['controller reports', v.control, v.control === 'aborted']]
        : [['frequency', v.kind === 'sweep' ? v.words : v.frequency_hz.toFixed(2) + ' Hz']]),
      ['commanded', v.commanded_g.toFixed(3) + unit], seen('controller', v.controller_g), seen('platform', v.platform_g), seen('table', v.table_g),
      ...(low === undefined ? [] : [['band', `${low.toFixed(3)} to ${high.toFixed(3)}${unit}`]])])]);
    const psd = v.psd || [], chart = byId('c-psd');
    chart.hidden = psd.length < 2;
    byId('psd-note').hidden = chart.hidden;
    if (chart.hidden) return;
    const words = `PSD of the profile as configured, at the ${v.psd_at}, at this level, g²/Hz, ${psd[0].hz} to ${psd[psd.length - 1].hz} Hz`;
    chart.setAttribute('aria-label', words);
    set('psd-note', words);
    Draw.chart('psd', [psd.map(p => p.hz), psd.map(p => p.g2_hz)]);
  }

  function show() {
    if (!status) return;
    head(status);
    gimbals(status);
    remember(status);
    charts(status);
    getEarlier(status);
    Draw.coefficients(status.estimate.parameters || [], targets, earlier);
    health(status);
    vibration(status);
    Watch.show(status);
  }

  function events(more) {
    const e = byId('events');
    for (const event of more) {
      lastEvent = Math.max(lastEvent, number(event.id));
      const li = document.createElement('li'), time = document.createElement('time');
      li.className = event.severity;
      time.dateTime = event.utc;
      time.textContent = Watch.clock(event.utc);
      time.title = event.utc;
      if (caughtUp) Watch.alarmed(event);
      li.append(time, `${event.source}: ${event.text}`);
      e.prepend(li);
    }
    while (e.children.length > kEvents) e.lastChild.remove();
  }

  async function getPlan() {
    try {
      plan = await (await fetch('/api/v1/plan')).json();
      targets = {};
      for (const p of plan.expected || []) if (p.target || p.sigma) targets[p.name] = p.target || p.sigma;
      set('target-note', plan.adaptive ? 'The bar is the standard deviation, in factors of ten above its target.'
        : 'The bar is the standard deviation, in factors of ten above what the plan lets expect at the end.');
      show();
    } catch { /* the stream tells when the link is lost */ }
  }

  // ---- the link
  function take(message) {
    heard = performance.now();
    switch (message.type) {
      case 'hello':
        if (instance && instance !== message.instance) {
          byId('events').textContent = '';
          lastEvent = 0;
          history.t = []; history.rows = [];
        }
        if (instance !== message.instance) getPlan();
        instance = message.instance;
        role = message.role;
        stopButton();
        break;
      case 'status':
        status = message.status;
        show();
        if (known !== instance) { known = instance; getHistory(); }   // once of each life of the daemon
        break;
      case 'delta': merge(status, message.patch); show(); break;
      case 'events': events(message.events); caughtUp = true; break;
    }
    state();
  }
  function connect() {
    const scheme = location.protocol === 'https:' ? 'wss:' : 'ws:';
    // Events of another life of the daemon count anew: all of them are asked for, known ones are skipped by instance.
    socket = new WebSocket(`${scheme}//${location.host}/api/v1/stream?rate_hz=${document.hidden ? kHidden_hz : kRate_hz}&after=${lastEvent}`);
    let greeted = false;
    const mine = socket;
    socket.onmessage = e => {
      if (mine !== socket) return;
      const message = JSON.parse(e.data);
      if (message.type === 'hello') {
        greeted = true;
        pause = 500;
        if (instance && instance !== message.instance && lastEvent > 0) {   // asked with an id of the old life
          lastEvent = 0;
          take(message);
          socket.close();
          return;
        }
      }
      take(message);
    };
    socket.onclose = () => {
      if (mine !== socket) return;
      socket = null;
      setTimeout(connect, greeted ? 200 : pause);
      pause = Math.min(pause * 1.6, 3000);
      state();
    };
  }
  function state() {
    const silent = performance.now() - heard, connected = socket && socket.readyState === WebSocket.OPEN;
    const lost = !connected && (silent > 1500 || !status), stale = connected && !document.hidden && silent > kStale_ms;
    document.body.classList.toggle('lost', lost && !!status);
    document.body.classList.toggle('stale', stale);
    document.body.classList.toggle('waiting', !status);
    const alert = byId('alert');
    const what = lost ? 'LINK LOST' : stale ? 'STALE' : '';
    alert.hidden = !what;
    if (what) {   // said once to a screen reader, counted for the eyes
      set('alert-text', `${what}: ${status ? 'what is shown is old' : 'no answer from vibrigd yet'}, trying again`);
      set('alert-age', status ? ` (${duration(silent / 1000)})` : '');
    }
    if (stale && silent > 3 * kStale_ms && socket) { socket.close(); heard += kStale_ms; }
    stopButton();
  }
  function stopButton() {
    const button = byId('stop'), may = role === 'operator' || role === 'admin';
    button.disabled = !may;
    const note = failing ? 'THE STOP WAS NOT ACCEPTED. Use the emergency stop.'
      : may ? 'Ramps the shaker down and ends the campaign. Not the emergency stop.'
        : 'Read-only here: operators stop with “vibrig abort”. Not the emergency stop.';
    if (byId('stop-note').textContent !== note) byId('stop-note').textContent = note;
  }
  byId('stop').addEventListener('click', async () => {   // without a question: a stop must not wait for one
    try {
      const reply = await fetch('/api/v1/commands', {method: 'POST', headers: {'Content-Type': 'application/json'},
        body: JSON.stringify({kind: 'abort', by: 'live page'}), signal: AbortSignal.timeout(5000)});
      failing = !reply.ok && reply.status !== 409;
    } catch { failing = true; }
    stopButton();
  });
  document.addEventListener('visibilitychange', () => {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({rate_hz: document.hidden ? kHidden_hz : kRate_hz}));
    heard = performance.now();
  });
  const theme = matchMedia('(prefers-color-scheme: dark)');
  theme.addEventListener('change', () => { Draw.again(); show(); });
  addEventListener('resize', Draw.resize);
  setInterval(state, 500);
  connect();
})();
