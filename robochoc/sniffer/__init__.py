"""The sniffer: conversations between robots, to be watched, inspected and saved (the paper's Figure 7)."""
