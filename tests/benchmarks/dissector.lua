-- The 3S-0 header for Wireshark, as a yardstick for the benchmark: nine fields, the data as bytes, no state.

local netvar = Proto("nv", "CODESYS network variables (3S-0)")

local services = {
  [0] = "ODStateFree",
  [1] = "ODReadRequest",
  [2] = "ODReadRequestReply",
  [3] = "ODWriteRequest",
  [4] = "ODWriteRequestReply",
  [5] = "ODAcknowledgement",
  [6] = "ODBootUpRequest",
  [20] = "ODErrorReplyUnknown",
  [21] = "ODErrorReplyItems",
  [22] = "ODErrorReplyAccess",
  [23] = "ODErrorReplyIdx",
  [24] = "ODErrorReplySub",
  [25] = "ODErrorReplyLen",
  [26] = "ODErrorWrongService",
  [27] = "ODErrorTimeOut",
  [28] = "ODErrorReplyCPUStopped",
  [100] = "ODStateBusy",
}

local identity = ProtoField.uint32("nv.identity", "Identity", base.HEX)
local id = ProtoField.uint32("nv.id", "ID", base.DEC, services)
local index = ProtoField.uint16("nv.index", "Index", base.DEC)
local subindex = ProtoField.uint16("nv.subindex", "SubIndex", base.DEC)
local items = ProtoField.uint16("nv.items", "Items", base.DEC)
local length = ProtoField.uint16("nv.length", "Length", base.DEC)
local counter = ProtoField.uint16("nv.counter", "Counter", base.DEC)
local flags = ProtoField.uint8("nv.flags", "Flags", base.HEX)
local checksum = ProtoField.uint8("nv.checksum", "Checksum", base.HEX)
local data = ProtoField.bytes("nv.data", "Data")

netvar.fields = { identity, id, index, subindex, items, length, counter, flags, checksum, data }

function netvar.dissector(buffer, packet, root)
  local size = buffer:len()
  if size < 20 then
    return 0
  end
  local first = buffer(0, 4):le_uint()
  if first ~= 0x33532D00 and first ~= 0x33532D30 then
    return 0
  end
  packet.cols.protocol = "3S-0"
  local tree = root:add(netvar, buffer())
  tree:add_le(identity, buffer(0, 4))
  tree:add_le(id, buffer(4, 4))
  tree:add_le(index, buffer(8, 2))
  tree:add_le(subindex, buffer(10, 2))
  tree:add_le(items, buffer(12, 2))
  tree:add_le(length, buffer(14, 2))
  tree:add_le(counter, buffer(16, 2))
  tree:add_le(flags, buffer(18, 1))
  tree:add_le(checksum, buffer(19, 1))
  if size > 20 then
    tree:add(data, buffer(20))
  end
  return size
end

DissectorTable.get("udp.port"):add(1202, netvar)
