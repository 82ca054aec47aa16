"""How fast a plant is held when its controller, the bus or the program fails: real processes in real time."""
