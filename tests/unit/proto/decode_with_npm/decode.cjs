// usage: node decode.cjs FOLDER_WITH_NODE_MODULES FILE.dbc < frames
//
// Reads lines "id hexpayload" (id as the DBC file writes it) and prints for every signal of the
// message "line name present value": present is 1 unless another multiplex value is in force.
// Message layout and integer bits are candied's work, written independently of Vibrig.
'use strict';

const fs = require('fs');
const path = require('path');

const [folder, file] = process.argv.slice(2);
let candied;
try {
    candied = require(path.join(folder, 'node_modules', 'candied'));
} catch (error) {
    console.error(`decode.cjs: candied cannot be loaded from '${folder}': ${error.message}`);
    process.exit(2);
}

const dbc = new candied.Dbc();
const data = dbc.load(fs.readFileSync(file, 'utf8'), true);
const can = new candied.Can();
can.database = data;
const byId = new Map([...data.messages.values()].map((message) => [message.id, message]));

// candied reads every signal as an integer; IEEE 754 is the JavaScript engine's own.
function decodeFloat(bytes, signal) {
    const view = new DataView(Uint8Array.from(bytes).buffer);
    const little = signal.endian === 'Intel';
    const size = signal.length / 8;
    const last = Math.floor(signal.startBit / 8);  // of a big-endian signal: see below
    const first = little ? last : last - size + 1;
    const raw = size === 8 ? view.getFloat64(first, little) : view.getFloat32(first, little);
    return raw * signal.factor + signal.offset;
}

// candied takes a big-endian signal's start bit for its least significant one, against the format.
// The test writes such files for it.
function decode(bytes, signal) {
    if (signal.dataType === 'float' || signal.dataType === 'double') {
        return decodeFloat(bytes, signal);
    }
    const unlimited = Object.assign({}, signal, {min: 0, max: 0});  // else it clamps to the range
    return can.decodeSignal(bytes, unlimited).value;
}

const out = [];
fs.readFileSync(0, 'utf8').split('\n').forEach((line, index) => {
    if (line === '') return;
    const [id, hex] = line.split(' ');
    const bytes = [...Buffer.from(hex, 'hex')];
    const message = byId.get(Number(id));
    if (message === undefined) {
        console.error(`decode.cjs: candied does not know message ${id} of line ${index + 1}`);
        process.exit(2);
    }
    const multiplexor = [...message.signals.values()].find((signal) => signal.multiplexer);
    for (const signal of message.signals.values()) {
        const wanted = /^m(\d+)$/.exec(signal.multiplex);
        const present = wanted === null || decode(bytes, multiplexor) === Number(wanted[1]);
        out.push(`${index} ${signal.name} ${present ? 1 : 0} ${decode(bytes, signal)}`);
    }
});
process.stdout.write(out.join('\n') + '\n');
