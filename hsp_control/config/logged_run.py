"""The configuration of a log as a document, and the controller of its run."""

import logging

from hsp_control.common.errors import ConfigError, HspControlError
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.control.controller import Controller
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.recorded import usable_record
from hsp_control.simulation import Rollout

_log = logging.getLogger(__name__)


def logged_document(
    rollout: Rollout, access: Access = ANYWHERE, imports_code: bool = False
) -> Document:
    """Return a log's configuration, with the robot in the log.

    Args:
        rollout: The log.
        access: The files that may be read.
        imports_code: Whether unchanged code that the log lists is imported also where
            access is strict.

    Raises:
        ConfigError: If the log has no configuration.
    """
    if rollout.config is None:
        raise ConfigError("the log has no configuration")
    document = Document(rollout.config, {}, "the log's configuration")
    document.access = access
    document.recorded_robot = usable_record(rollout.meta)
    document.imports_recorded_code = imports_code
    document.recorded_code = rollout.meta.get("imported") or {}
    return document


def logged_controller(
    rollout: Rollout, access: Access = ANYWHERE, imports_code: bool = False
) -> Controller | None:
    """Return the controller of a log before the run, if it can be rebuilt.

    The arguments are those of `logged_document`.
    """
    try:
        return build(logged_document(rollout, access, imports_code)).controller
    except HspControlError as error:
        _log.debug("no controller: %s", error)
        return None
