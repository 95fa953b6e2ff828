"""The version, in one place: the package, its stores and its reports all quote it."""

VERSION = "0.3.0"
