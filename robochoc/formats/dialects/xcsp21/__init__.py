"""XCSP 2.1 with agents, which FRODO and DisChoco share (Roussel and Lecoutre, arXiv 0902.2362)."""
