"""The files of a capture: which one is which photograph, and what is read from it (ch. 12)."""
