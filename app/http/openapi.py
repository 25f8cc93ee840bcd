"""The OpenAPI document: that of FastAPI, and the schemas of the answers that are serialised without a model."""

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from pydantic import BaseModel

from app.http.problems import API
from app.schemas.batch import BatchLine
from app.schemas.calibration import MeasurementResponse
from app.schemas.response import JobResponse, PredictionResponse, ProblemDocument, problem_document

_REFERENCE = "#/components/schemas/{model}"


def install(app: FastAPI) -> None:
    """Make ``app.openapi`` describe problems and predictions as they are sent."""
    described = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = described()
            schemas = document.setdefault("components", {}).setdefault("schemas", {})
            for model in (PredictionResponse, JobResponse, BatchLine, MeasurementResponse, ProblemDocument):
                schemas.update(_schemas(model))
            for address, path in document["paths"].items():
                for operation in path.values():
                    _describe_bad_request(address, operation["responses"])
                    if "401" in operation["responses"]:
                        operation["responses"]["403"] = problem_document(
                            "The request comes from a page of another site."
                        )
            _add_enums(document)
            _add_token(document, is_needed=app.state.settings.token is not None)
            for name in ("HTTPValidationError", "ValidationError"):
                schemas.pop(name, None)
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def operation_id(route: APIRoute) -> str:
    """Return the id of an operation, after which generated clients call their function: its tags and its own name."""
    return "_".join([*map(str, route.tags), route.name])


def _schemas(model: type[BaseModel]) -> dict[str, Any]:
    schema = model.model_json_schema(ref_template=_REFERENCE, mode="serialization")
    parts = schema.pop("$defs", {})
    return {**parts, model.__name__: schema}


def _add_enums(node: Any) -> None:
    """Also write each constant as the only value of an enum, which more client generators understand."""
    if isinstance(node, dict) and isinstance(node.get("const"), str):
        node["enum"] = [node["const"]]
    for part in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        _add_enums(part)


def _add_token(document: dict[str, Any], *, is_needed: bool) -> None:
    """Describe the bearer token of every address that can answer 401; it is optional if the service needs none."""
    description = "The token of the service (`DLO_TOKEN`), if it has one."
    schemes = document["components"].setdefault("securitySchemes", {})
    schemes["token"] = {"type": "http", "scheme": "bearer", "description": description}
    for path in document["paths"].values():
        for operation in path.values():
            if "401" in operation["responses"]:
                operation["security"] = [{"token": []}] if is_needed else [{}, {"token": []}]


def _describe_bad_request(address: str, responses: dict[str, Any]) -> None:
    """Describe the answer to a bad request where the route does not: any address of the API can get a bad query.

    This replaces the description that FastAPI adds wherever something is validated.
    """
    content = responses.get("422", {}).get("content", {})
    if "application/json" in content or ("422" not in responses and address.startswith(API)):
        responses["422"] = problem_document("The request is wrong: `errors` names each field.")
