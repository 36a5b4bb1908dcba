"""A data set on disk as others get it: its layout, checksums, signature and archive."""
