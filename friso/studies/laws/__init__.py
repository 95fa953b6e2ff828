"""Friction laws side by side: from one to another, and the verdict under each that keeps what is measured."""
