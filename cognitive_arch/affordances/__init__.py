"""What can be done with things: tables of trials, networks learned from them, and questions to these."""
