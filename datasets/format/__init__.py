"""What a dataset looks like on disk: arrays, columns, headers, digests, decisions. Knows neither history nor files."""
