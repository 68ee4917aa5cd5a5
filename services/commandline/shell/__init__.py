"""Parts that all commands share: options, configuration, processes, exit codes and output."""
