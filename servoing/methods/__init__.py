"""Servo methods: one file each, and the registry in which each is entered once."""
