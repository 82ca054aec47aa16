"""How fast a plant is held when its controller is killed, stopped or hangs: real processes in real time."""
