"""What a log holds of contacts: forces, centres of pressure, and friction in use."""

import numpy as np

from hsp_control.control.controller import Controller
from hsp_control.control.output import ControlOutput
from hsp_control.simulation.log_columns import LogColumns


class ContactColumns:
    """The columns of all contacts of a controller."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns.arrays
        for contact in controller.contacts:
            prefix, column = f"contact.{contact.name}", columns.add
            column(f"{prefix}.force", (3,), "N", "on the robot, in world axes")
            if contact.force is not None:
                meaning = "force that is commanded, in world axes"
                column(f"{prefix}.commanded", (3,), "N", meaning)
            column(f"{prefix}.position", (3,), "m", "centre of pressure")
            column(f"{prefix}.weight", (), "-", "how much it bears, 0 to 1")
            column(
                f"{prefix}.friction_used", (), "-", "largest ‖f_t‖/(μ f_n) of a point"
            )

    def write(self, row: int, t: float, output: ControlOutput) -> None:
        """Write a row."""
        controller, columns = self._controller, self._columns
        if not controller.contacts:
            return
        support = controller.active_stack.support
        world = support.in_world(output.forces)
        commanded = support.in_world(support.reference)
        for contact in controller.contacts:
            prefix = f"contact.{contact.name}"
            force = columns[f"{prefix}.force"][row]
            center = columns[f"{prefix}.position"][row]
            force[:], center[:] = 0.0, np.nan
            columns[f"{prefix}.weight"][row] = controller.bearing_of(contact.name, t)
            if contact not in support.contacts:
                continue
            points = support.points[support.contacts.index(contact)]
            local = output.forces.reshape(-1, 3)[points]
            force[:] = world[points].sum(axis=0)
            if contact.force is not None:
                total = commanded[points].sum(axis=0)
                columns[f"{prefix}.commanded"][row] = total
            normal = np.maximum(local[:, 2], 1e-9)
            center[:] = normal @ support.positions[points] / normal.sum()
            tangential = np.hypot(local[:, 0], local[:, 1])  # without overflow
            loaded = local[:, 2] > 1e-3  # [N]: below it the ratio is rounding
            ratios = tangential[loaded] / (contact.friction * local[loaded, 2])
            columns[f"{prefix}.friction_used"][row] = ratios.max(initial=0.0)
