from .log import log_to_rerun as log_to_rerun
