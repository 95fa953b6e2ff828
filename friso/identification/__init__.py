"""From measured logs to a stage: reading, frequency responses, parameters in time, fits of the whole model."""
