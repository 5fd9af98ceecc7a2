"""Fields of parts that accept in Python more than YAML can say."""

from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from hsp_control.declaration.quantities import ArrayField


class OrInstance(ArrayField):
    """The validation of a field: what YAML says, or in Python an instance of a class.

    As an annotation: ``Annotated[str | Obstacle, OrInstance(Name, Obstacle)]``. Schemas
    and messages mention only what YAML says.

    Attributes:
        instance_of: The class.
    """

    def __init__(self, items: Any, instance_of: type) -> None:
        """Set the type of YAML and the class."""
        super().__init__(items, lambda value: value)
        self.instance_of = instance_of

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return pydantic's schema."""
        return core_schema.no_info_wrap_validator_function(
            lambda value, check: (
                value if isinstance(value, self.instance_of) else check(value)
            ),
            handler.generate_schema(self.items),
        )
