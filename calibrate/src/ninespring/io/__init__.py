"""What comes in: logs, TOML files, other people's files, the board and its port."""
