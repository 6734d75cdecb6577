"""Leaders that are devices: a stylus behind a rosbridge or a bridge of its own, a gamepad."""
