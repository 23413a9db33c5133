"""Face: the page and the HTTP API. It turns requests into nouns and documents into answers, and measures nothing itself."""
