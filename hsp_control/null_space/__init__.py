"""What self-motion does: fields g with their rates g', and the metric W it lives in."""
