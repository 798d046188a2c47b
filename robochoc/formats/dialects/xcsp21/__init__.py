"""What FRODO's files and DisChoco's have in common: XCSP 2.1 with agents (Roussel and Lecoutre, arXiv 0902.2362)."""
