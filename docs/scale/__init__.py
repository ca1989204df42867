"""What frames, drives and policies cost: measurements, table and picture of docs/scale.md."""
