"""The rig: the processes of a trial, the bus between them, and who watches over them."""
