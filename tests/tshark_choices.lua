-- For tshark: which frames each display filter chooses, so that one run answers for all of them, which stand in the lines
-- of its argument. Prints the place of a filter, and the number of a frame that it chooses, or "refused".
local place = 0
for filter in (...):gmatch("[^\n]+") do
    place = place + 1
    local here = place
    local accepted, tap = pcall(Listener.new, "frame", filter)
    if accepted then
        function tap.packet(frame)
            io.stdout:write(here, " ", frame.number, "\n")
        end
    else
        io.stdout:write(here, " refused\n")
    end
end
