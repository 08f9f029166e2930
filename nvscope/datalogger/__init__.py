"""DataLogger: variables recorded as a PLCnext controller does, and audits of such databases."""
