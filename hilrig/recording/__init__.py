"""What a run leaves on disk: the messages of its trials, the bags that hold them, and the run directory around them.

Other rooms use:

- `run_directory`: where the files of a run are, and how to write and read them; `manifest`: the provenance of a run;
- `messages.layouts`: the channels of a trial and the codec of each; `messages.record_batch`: many messages as arrays;
- `recorder.Recorder`: writes a trial's bag; `bag.read_bag`: reads one;
- `timing.certify`: the timing certificate of a trial; `certificate`: the mathematics behind it;
- `fault_log`: the faults that were injected into a trial.
"""
