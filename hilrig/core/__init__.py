"""The vocabulary: signals, the interfaces of the kinds, parameters and their units, errors, the compiler."""
