// Give every telegram of a capture to the receiver node of node-red-contrib-nvl, one node a list, without the rest of
// Node-RED, and count what comes out. What is decoded is let go.
//
//     NODE_PATH=DIRECTORY/node_modules node tests/benchmarks/node_red.js CAPTURE GVL...
"use strict";
const fs = require("fs");

const nodes = new Map();
let count = 0;
const done = () => {};
const count_it = () => { count += 1; };

let make = null;
require("node-red-contrib-nvl/src/nvl-receive.js")({
    nodes: {
        createNode(node) {
            node.on = (event, handler) => { node.handler = handler; };
            node.status = done;
            node.error = (error) => { throw error; };
        },
        getNode: () => null,
        registerType: (name, type) => { make = type; },
    },
});
for (const file of process.argv.slice(3)) {
    const text = fs.readFileSync(file, "latin1");
    const listId = Number(text.match(/<ListIdentifier>(\d+)</)[1]);
    const definition = text.slice(text.indexOf("VAR_GLOBAL"), text.indexOf("END_VAR") + "END_VAR".length);
    nodes.set(listId, new make({ listId, definition }));
}

const capture = fs.openSync(process.argv[2], "r");
let data = Buffer.alloc(64 << 20);
let have = fs.readSync(capture, data, 0, data.length, 0);
let read = have, at = 24;
for (;;) {
    if (have - at < (1 << 18) + 16) {
        data.copy(data, 0, at, have);
        have -= at;
        at = 0;
        const more = fs.readSync(capture, data, have, data.length - have, read);
        have += more;
        read += more;
    }
    if (at >= have) break;
    const captured = data.readUInt32LE(at + 8);
    const start = at + 16;
    at = start + captured;
    if (captured < 62 || data.readUInt16BE(start + 12) !== 0x0800 || data[start + 23] !== 17) continue;
    if (data.readUInt32LE(start + 42) !== 0x33532d00 || data.readUInt32LE(start + 46) !== 0) continue;
    const node = nodes.get(data.readUInt16LE(start + 50));
    const length = data.readUInt16LE(start + 56);
    if (node && captured === 42 + length) {
        node.handler({ payload: data.subarray(start + 42, start + captured) }, count_it, done);
    }
}
console.log(count);
