"""What `friso logs` shows of files of logs."""
