"""The physics, declared once as symbols, and which of it a stage needs."""
