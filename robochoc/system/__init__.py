"""What Python and the operating system offer, each wrapped once: files, plug-ins, text for terminals."""
