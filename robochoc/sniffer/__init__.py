"""The sniffer: shows, inspects and saves the conversations between robots (the paper's Figure 7)."""
