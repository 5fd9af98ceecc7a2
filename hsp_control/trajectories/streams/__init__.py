"""References that are streamed: messages become a C² motion within bounds."""
