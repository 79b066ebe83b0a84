"""Pictures: everything that draws, and nothing that knows a command."""
