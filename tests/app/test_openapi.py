"""The OpenAPI document: valid, and good for those who generate clients from it."""

import json
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from fastapi.testclient import TestClient
from pydantic import BaseModel

from app.main import create_app
from app.schemas import PredictionList, PredictionResponse
from app.schemas.batch import BatchLine
from app.schemas.fit import FIT_EXAMPLES, FitResponse
from app.schemas.plan import PlanResponse
from app.settings import Settings
from tests.app.conftest import paper_scene


@pytest.mark.parametrize("token", [None, "a long token"])
def test_the_openapi_document_is_valid_and_knows_of_the_token(tmp_path: Path, token: str | None) -> None:
    document = create_app(Settings(data_dir=tmp_path, token=token)).openapi()
    assert document["openapi"] == "3.1.0"
    schemathesis.openapi.from_dict(document).validate()
    assert document["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    needed = document["paths"]["/v1/predictions"]["post"]["security"]
    assert needed == ([{"token": []}] if token else [{}, {"token": []}])
    assert "security" not in document["paths"]["/health"]["get"]


def test_openapi_has_each_constant_as_an_enum_too(client: TestClient) -> None:
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    kinds = [part["properties"]["kind"] for part in schemas.values() if "kind" in part.get("properties", {})]
    assert len(kinds) > 10
    assert all(kind["enum"] == [kind["const"]] for kind in kinds if "const" in kind)


def test_operations_have_short_ids_of_their_own_that_clients_name_functions_after() -> None:
    paths = create_app().openapi()["paths"]
    ids = [operation["operationId"] for path in paths.values() for operation in path.values()]
    assert len(set(ids)) == len(ids)
    assert {"predictions_predict", "predictions_batch", "scenes_explain", "studies_listed", "service_ready"} < set(ids)
    assert not [id for id in ids if "_v1_" in id or "__" in id]


def test_every_course_of_events_can_be_over() -> None:
    paths = create_app().openapi()["paths"]
    courses = [path["get"]["responses"] for address, path in paths.items() if address.endswith("/events")]
    assert len(courses) == 3
    assert all("204" in answers for answers in courses)


def _examples() -> list[Any]:
    """Return the address and the body of each example of a request."""
    found = []
    for address, path in create_app().openapi()["paths"].items():
        for operation in path.values():
            for form in operation.get("requestBody", {}).get("content", {}).values():
                for name, example in form.get("examples", {}).items():
                    found.append(pytest.param(address, example["value"], id=f"{address} {name}"))
    return found


@pytest.mark.parametrize(("address", "example"), _examples())
def test_every_example_of_a_request_succeeds(client: TestClient, address: str, example: dict[str, Any]) -> None:
    response = client.post(address, json=example)
    assert response.is_success, response.text
    if response.status_code == 202:  # a study goes on
        client.delete(response.headers["location"])
    for line in response.text.splitlines() if address.endswith(":batch") else ():
        assert "result" in json.loads(line), line


def test_the_example_of_a_cloud_has_the_one_point_left_out_that_is_not_of_the_cable(client: TestClient) -> None:
    example = FIT_EXAMPLES["cloud"]["value"]
    found = client.post("/v1/shapes:fit", json=example).json()
    assert [example["points"][i] for i in found["outliers"]] == [[0.3, 0.6]]
    assert found["fit_error"]["max"] < 0.01


@pytest.mark.parametrize(
    ("model", "address", "body"),
    [
        (PredictionResponse, "/v1/predictions", paper_scene()),
        (PredictionResponse, "/v1/predictions?store=false", paper_scene(quality={"method": "reference"})),
        (BatchLine, "/v1/predictions:batch", {"scenes": [paper_scene()]}),
        (PlanResponse, "/v1/scenes:explain", paper_scene()),
        (FitResponse, "/v1/shapes:fit", FIT_EXAMPLES["ordered"]["value"]),
        (PredictionList, "/v1/predictions", None),
    ],
)
def test_an_answer_has_no_field_that_the_schema_does_not_know(
    client: TestClient, model: type[BaseModel], address: str, body: Any
) -> None:
    answer = (client.get(address) if body is None else client.post(address, json=body)).json()
    assert model.model_validate(answer).model_dump(mode="json", exclude_unset=True) == answer
