"""The OpenAPI document: valid, and good for those who generate clients from it."""

from pathlib import Path

import pytest
import schemathesis
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings


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
