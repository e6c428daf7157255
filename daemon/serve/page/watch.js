'use strict';
// What somebody on duty needs: is all well, what happened, what to do next, and a sound when it is not.
const Watch = (() => {
  const {byId} = Draw;
  const kNames = {outer: 'gimbal outer', inner: 'gimbal inner', azimuth: 'gimbal azimuth', accel_x: 'accelerometer x', accel_y: 'accelerometer y',
    accel_z: 'accelerometer z', table_accel: 'table accelerometer'};
  const kLocks = {emergency_stop: 'emergency stop', shaker_fault: 'shaker fault', uncommanded: 'shaker uncommanded', disk_low: 'free disk', can_lost: 'CAN bus'};
  const person = name => kNames[name] || kLocks[name] || name.replaceAll('_', ' ');
  const number = x => (x === undefined ? NaN : Number(x));
  const clock = utc => new Date(utc).toISOString().slice(11, 19);
  const element = (tag, kind, ...inside) => { const e = document.createElement(tag); if (kind) e.className = kind; e.append(...inside); return e; };

  function duration(s) {
    s = Math.round(s);
    if (!(s >= 0)) return '–';
    return s >= 3600 ? `${Math.floor(s / 3600)} h ${String(Math.floor(s / 60) % 60).padStart(2, '0')} min`
      : s >= 60 ? `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, '0')} s` : `${s} s`;
  }

  // The single values of a status, as the daemon's table of them says (/values.js): by line, what it says and whether
  // that is alarming.
  const value = (s, v) => v.field.split('.').reduce((part, name) => (part === undefined ? part : part[name]), s);
  function said(v, x) {
    const put = text => v.words.replace('{}', () => text), unit = v.unit && !v.duration ? ' ' + v.unit : '';
    if (typeof x === 'boolean') return x ? v.words : v.otherwise || '';
    if (x === undefined || x === '') return v.number && v.otherwise === null ? put('–' + unit) : v.otherwise || '';
    return put(!v.number ? x : (v.duration ? duration(Number(x)) : v.decimals < 0 ? String(x) : Number(x).toFixed(v.decimals)) + unit);
  }
  function lines(s) {
    const all = new Map();
    for (const v of kValues) {
      const x = value(s, v), text = said(v, x), line = all.get(v.line) || {text: '', bad: false};
      if (!text || (v.unless && value(s, {field: v.unless}))) continue;
      all.set(v.line, {text: line.text + (line.text && ', ') + text, bad: line.bad || (v.alarming && Number(x) > 0)});
    }
    return all;
  }

  function strip(s) {
    const rows = s.interlock.rows || [], raised = rows.filter(r => r.raised);
    const lost = number(s.can.kernel_dropped) + number(s.estimator_ring.dropped);
    const bad = (s.sample.channels || []).filter(c => c.quality !== 'unbound' && (c.quality !== 'good' || !(c.age_s <= 1)));
    const r = s.recorder, j = s.journal, doors = (s.server.doors || []).filter(d => !d.open);
    const own = (s.server.certificates || []).filter(c => c.whose === 'server' || c.whose === 'authority');
    const days = Math.min(...own.map(c => c.days_left));
    const items = [
      [raised.length ? (raised.some(x => x.reaction === 'abort') ? 'bad' : 'warn') : '', `${rows.length - raised.length} of ${rows.length} interlocks healthy`],
      [bad.length ? 'bad' : '', bad.length ? `${bad.map(c => person(c.name)).join(', ')} ${bad.length > 1 ? 'are' : 'is'} not good` : 'channels good'],
      [lost ? 'bad' : '', `${lost} samples lost`],
      [s.can.link === 'running' ? '' : 'bad', `CAN ${s.can.link}`], [s.shaker.link === 'running' ? '' : 'bad', `shaker ${s.shaker.link}`],
      [r.folder ? (r.good ? '' : 'warn') : 'off', r.folder ? (r.good ? (r.recording ? 'recorder records' : 'recorder ok') : 'recorder: ' + (r.note || 'degraded')) : 'no recorder'],
      [j.path ? (j.running ? '' : 'bad') : 'off', j.path ? (j.running ? 'journal ok' : 'journal waits') : 'no journal'],
      ...(s.archive ? [[s.archive.good && !Number(s.archive.refused) ? '' : 'warn', (s.archive.good ? 'archive ok' : 'archive: ' + s.archive.note) + (Number(s.archive.waiting) ? `, ${s.archive.waiting} waiting` : '') + (Number(s.archive.refused) ? `, ${s.archive.refused} refused` : '')]] : []),
      ...(s.guard ? [guard(s.guard)] : []), ...(s.annunciator ? horn(s.annunciator) : []),
      ...(s.log.blocked ? [['warn', 'log: nobody reads it']] : []),
      ...doors.map(d => ['bad', `${d.name} door shut`]),
      ...(own.length ? [[days <= 0 ? 'bad' : days <= 30 ? 'warn' : '', days <= 0 ? 'a certificate has EXPIRED' : `certificates ${Math.floor(days)} days`]] : [])];
    const e = byId('strip'), key = JSON.stringify(items);
    if (e.dataset.key === key) return;
    e.dataset.key = key;
    e.replaceChildren(...items.map(([kind, words]) => element('li', kind, words)));
  }

  // Who watches from outside, and what makes itself heard.
  const guard = g => (!g.heard ? ['bad', 'GUARD NOT HEARD: ' + g.note] : g.text ? ['bad', 'guard: ' + g.text]
    : !g.sees ? ['bad', 'guard sees no accelerometer'] : !g.reaches_shaker ? ['bad', 'guard does not reach the shaker'] : g.note ? ['warn', 'guard watches, ' + g.note] : ['', 'guard watches']);
  const horn = a => [
    ...(a.horn ? [a.confirms ? [a.pattern && a.pattern !== 'none' ? 'warn' : '', a.pattern && a.pattern !== 'none' ? 'horn sounds: ' + a.pattern : 'horn ready'] : ['bad', 'HORN: ' + a.horn_note]] : []),
    ...(a.command ? [a.command_note ? ['warn', 'pager: ' + a.command_note] : ['', 'pager ready']] : [])];

  // The newest proof of the safe state; its stop times as small columns, oldest first: what wears rises.
  const kMarks = '▁▂▃▄▅▆▇█';
  function columns(times) {
    const most = Math.max(...times);
    return times.map(t => (t > 0 ? kMarks[Math.min(7, Math.floor(8 * t / (most * 1.0001)))] : '·')).join('');
  }
  function proof(s) {
    const p = s.proof || {}, e = byId('proof'), past = (p.history || []).slice(-24);
    const seconds = name => { const r = (p.rows || []).find(x => x.name === name); return r && r.value !== undefined ? r.value.toFixed(2) + ' s' : '–'; };
    const trend = key => (past.length > 1 ? ' ' + columns(past.map(x => x[key] || 0)) : '');
    const wrong = (p.rows || []).filter(r => !r.passed).map(r => r.name);
    const items = [['state', !p.by ? 'not proved' : p.passed ? 'proved' : 'NOT PROVED: ' + p.message, p.demanded && !!p.refusal],
      ...(p.by ? [['by', p.by], ['when', new Date(Number(p.utc_ns) / 1e6).toISOString().slice(0, 16).replace('T', ' ') + ' UTC'],
        ['stop, table', seconds('stop, table') + trend('table_s'), wrong.includes('stop, table')],
        ['stop, platform', seconds('stop, platform') + trend('stop_s'), wrong.includes('stop, platform')],
        ['watchdog, rest', seconds('watchdog, rest') + trend('watchdog_s'), wrong.includes('watchdog, rest')],
        ['keys', 'SHA-256 ' + (p.keys_sha256 || '').slice(0, 12)]] : []),
      ...(p.trend ? [['trend', p.trend, true]] : []), ...(p.refusal ? [['no arming', p.refusal, p.demanded]] : []),
      ...(p.advice ? [['to do', p.advice]] : [])];
    const key = JSON.stringify(items);
    if (e.dataset.key === key) return;
    e.dataset.key = key;
    e.replaceChildren(...items.flatMap(([name, words, bad]) => [element('dt', '', name), element('dd', bad ? 'bad-value' : '', words)]));
  }

  // One line of each interlock: name, value and limit, and how much of the limit is used.
  const short = x => (Math.abs(x) >= 1e5 ? x.toExponential(1) : String(+x.toPrecision(3)));
  function locks(s) {
    const e = byId('interlock'), rows = s.interlock.rows || [];
    while (e.children.length > rows.length) e.lastChild.remove();
    rows.forEach((r, i) => {
      let li = e.children[i];
      if (!li) { li = element('li', '', element('span'), element('span', 'value'), element('span', 'bar', element('i'))); e.append(li); }
      const kind = r.raised ? (r.reaction === 'abort' ? 'bad' : 'warn') : r.present === undefined ? 'off' : '';
      if (li.className !== kind) li.className = kind;
      const value = r.raised && r.value !== undefined ? r.value : r.present;
      const words = r.limit === undefined ? (r.raised ? 'RAISED' : r.present === undefined ? 'not watched now' : 'ok')
        : `${r.raised ? 'RAISED ' : ''}${value === undefined ? '–' : short(value)} / ${short(r.limit)} ${r.unit.replace('of the motion along it', 'of axial')}`;
      const used = r.raised ? 1 : r.margin === undefined ? 0 : Math.min(1, Math.max(0, 1 - r.margin));
      const [name, text, bar] = li.children;
      if (name.textContent !== person(r.name)) name.textContent = person(r.name);
      if (text.textContent !== words) text.textContent = words;
      bar.firstChild.style.width = Math.round(100 * used) + '%';
      bar.firstChild.className = used > 0.8 && !r.raised ? 'near' : '';
      li.title = `${r.condition.replaceAll('_', ' ')}: ${r.reaction}${r.dwell_s ? ` after ${r.dwell_s} s` : ''}`;
    });
  }

  // What happened and what to do next: each step with whether it is done.
  function next(s) {
    const c = s.campaign, shaker = s.shaker, e = byId('next');
    const disobeyed = isDisobeyed(s), tripped = c.state === 'tripped' || !!s.interlock.tripped;
    e.hidden = !tripped && !disobeyed;
    document.body.classList.toggle('stopped', !e.hidden);
    if (e.hidden) return;
    const what = disobeyed ? 'A STOP IS NOT OBEYED. Press the emergency stop.' : `Stopped by ${person(s.interlock.tripped || 'an interlock')}: ${c.reason || ''}`;
    const closed = shaker.emergency_stop_open === false, rests = shaker.rest === 'at rest';
    const armed = c.state === 'armed', chain = /emergency/.test(s.interlock.tripped + c.reason) || !closed;
    // One acknowledgement is for all of them; the heading has said the cause.
    const latches = s.interlock.latches || [], several = latches.length > 1;
    const steps = [
      ...(disobeyed ? [['Press the emergency stop; keep away from the table', shaker.emergency_stop_open === true]] : []),
      ['Look at the rig: the table is at rest', rests],
      ...(!chain || several ? [[several ? 'Mend the causes' : 'Mend the cause', false]] : []),
      ...(chain ? [['Close the emergency-stop chain', closed && !disobeyed]] : []),
      ['vibrig ack ' + (latches.length === 1 ? latches[0].name : 'trip'), !tripped], ['Prove: vibrig selftest --by "YOUR NAME"', false],
      ['vibrig arm --by "YOUR NAME", then vibrig start, or resume what was interrupted', armed]];
    const key = JSON.stringify([what, steps]);
    if (e.dataset.key === key) return;
    e.dataset.key = key;
    byId('next-what').textContent = what;
    byId('next-steps').replaceChildren(...steps.map(([words, done]) => element('li', done ? 'done' : '', words + (done ? ' ✓' : ''))));
  }
  const isDisobeyed = s => s.shaker.rest === 'stop not obeyed' || !!(s.guard && s.guard.heard && s.guard.disobeyed && !s.guard.rest);

  // Three sounds that nobody takes for one another: an alarm asks (two even tones), an abort falls, a stop that is not
  // obeyed is a siren. A trip repeats until it is acknowledged.
  let audio = null, playing = '', timer = 0;
  const kPatterns = {   // [Hz, from s, for s]; and again after s
    alarm: {tones: [[880, 0, .18], [880, .3, .18]], again: 0},
    abort: {tones: [[740, 0, .25], [587, .28, .25], [440, .56, .45]], again: 3},
    disobeyed: {tones: Array.from({length: 8}, (_, i) => [i % 2 ? 1180 : 820, i * .25, .25]), again: 2}};
  function sound(name) {
    if (!audio) return;
    for (const [hz, from, length] of kPatterns[name].tones) {
      const tone = audio.createOscillator(), level = audio.createGain(), at = audio.currentTime + from;
      tone.type = 'square';
      tone.frequency.value = hz;
      level.gain.setValueAtTime(0, at);
      level.gain.linearRampToValueAtTime(.2, at + .01);
      level.gain.setValueAtTime(.2, at + length - .02);
      level.gain.linearRampToValueAtTime(0, at + length);
      tone.connect(level).connect(audio.destination);
      tone.start(at);
      tone.stop(at + length);
    }
    const button = byId('sound');
    button.dataset.played = (button.dataset.played ? button.dataset.played + ' ' : '') + name;
  }
  function sirens(s) {
    const wanted = isDisobeyed(s) ? 'disobeyed' : s.campaign.state === 'tripped' ? 'abort' : '';
    if (wanted === playing) return;
    playing = wanted;
    clearInterval(timer);
    if (!wanted) return;
    sound(wanted);
    timer = setInterval(() => sound(playing), 1000 * kPatterns[wanted].again);
  }
  byId('sound').addEventListener('click', () => {   // a browser lets nobody make a noise before a click
    if (audio) { audio.close(); audio = null; } else { audio = new AudioContext(); sound('alarm'); playing = ''; }
    byId('sound').setAttribute('aria-pressed', String(!!audio));
    byId('sound').textContent = audio ? 'Sound: on' : 'Sound: off';
  });
  const alarmed = event => { if (event.severity === 'alarm' && !playing) sound('alarm'); };

  return {person, clock, duration, lines, strip, locks, next, sirens, alarmed, show(s) { strip(s); proof(s); locks(s); next(s); sirens(s); byId('simulated').hidden = s.simulated !== true; byId('utc').textContent = clock(s.utc) + ' UTC'; }};
})();
