"""The configuration of a log as a document, and the controller of its run."""

import logging

from hsp_control.common.exceptions import ConfigError, HspControlError
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.control.controller import Controller
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.recorded import usable_record
from hsp_control.simulation import Rollout

_log = logging.getLogger(__name__)


def logged_document(rollout: Rollout, access: Access = ANYWHERE) -> Document:
    """Return a log's configuration, with the robot in the log.

    Raises:
        ConfigError: If the log has no configuration.
    """
    if rollout.config is None:
        raise ConfigError("the log has no configuration")
    document = Document(rollout.config, {}, "the log's configuration")
    document.access = access
    document.recorded_robot = usable_record(rollout.meta)
    document.recorded_code = rollout.meta.get("imported") or {}
    return document


def logged_controller(rollout: Rollout, access: Access = ANYWHERE) -> Controller | None:
    """Return the controller of a log before the run, if it can be rebuilt."""
    try:
        return build(logged_document(rollout, access)).controller
    except HspControlError as error:
        _log.debug("no controller: %s", error)
        return None
