"""What `advpipe verify` looks at, one noun a file."""
