"""Every format that is read."""

from . import command_words, map_files, mcap_files, recording_files, run_folders, video_files

FORMATS = [
    mcap_files.BYTES,
    mcap_files.RECORDS,
    recording_files.BAG,
    recording_files.FOLDER,
    recording_files.TABLE,
    recording_files.IMAGE,
    recording_files.CAMERA,
    recording_files.GRID,
    video_files.VIDEO,
    video_files.TRUTH,
    map_files.BYTES,
    map_files.CONTENT,
    map_files.LANDMARKS,
    run_folders.RUN,
    run_folders.CACHE,
    command_words.EXPERIMENT,
    command_words.CONFIG,
    command_words.WORDS,
]
