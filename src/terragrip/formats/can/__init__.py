"""CAN logs: frames in, signals out, by a DBC or by the built-in table of J1939 and ISO 11783."""
