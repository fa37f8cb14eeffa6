"""What goes wrong with a capture, and how it is told: responses, flicker, mounting (ch. 12)."""
