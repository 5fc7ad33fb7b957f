"""Running a model: emulator or recording, senders, a bus, a detector node."""
