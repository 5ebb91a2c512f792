"""What the client of the official SDK gets from `gprop mcp`: python3 client.py GPROP ROOT ANSWER_JSON -> JSON on the last line.

ROOT holds a scene `ball-0` whose questions all have the same answer.
"""

import asyncio
import base64
import json
import os
import sys
import warnings

from mcp import Client, StdioServerParameters, types
from mcp.shared.exceptions import MCPError

PROGRAM, ROOT, ANSWER = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
SERVER = StdioServerParameters(command=PROGRAM, args=["mcp", "--root", ROOT], env=dict(os.environ))


def parsed(result):
    return json.loads(result.content[0].text)


async def roots(_context):
    return types.ListRootsResult(roots=[types.Root(uri=f"file://{ROOT}/ball-0")])


async def main():
    found = {}
    async with Client(SERVER) as client:
        found["version"] = client.protocol_version
        found["tools"] = sorted(tool.name for tool in (await client.list_tools()).tools)
        inspected = await client.call_tool("inspect", {"scene": "ball-0"})
        found["gaussians"] = json.loads(inspected.content[-1].text if inspected.is_error else inspected.content[0].text)["gaussians"]
        early = await client.call_tool("run", {"scene": "ball-0", "to": "parts"})
        found["early"] = {"is_error": early.is_error, "text": early.content[0].text}
        found["rounds"] = []
        while True:
            asked = await client.call_tool("questions", {"scene": "ball-0", "most": 4})
            about = parsed(asked)
            if about["open"] == 0:
                break
            pictures = [base64.b64decode(part.data)[:3].hex() for part in asked.content if part.type == "image"]
            mime_types = {part.mime_type for part in asked.content if part.type == "image"}
            schemas = [about["texts"][one["text"]]["schema"]["type"] for one in about["questions"]]
            answers = [{"query": one["query"], "answer": ANSWER} for one in about["questions"]]
            answered = await client.call_tool("answers", {"scene": "ball-0", "name": "an agent", "answers": answers})
            found["rounds"].append(
                {"open": about["open"], "pictures": pictures, "mime_types": sorted(mime_types), "schemas": schemas, "standing": parsed(answered)}
            )
        told = []

        async def progress(done, _total, message):
            told.append((done, message))

        parts = parsed(await client.call_tool("run", {"scene": "ball-0", "to": "parts"}))
        # Small enough for the gripper.
        to_grasp = {"scene": "ball-0", "to": "grasp", "scale": 0.4}
        run = await client.call_tool("run", to_grasp, progress_callback=progress)
        found["run"] = {"is_error": run.is_error, "text": run.content[0].text[:300], "told": told}
        found["grasp"] = parsed(await client.call_tool("grasp", {"scene": "ball-0"}))["f_min_n"]
        found["mass_kg"] = parts["object"]["mass_kg"]
        exported = await client.call_tool("export", {"scene": "ball-0", "out": "model", "format": ["npz", "urdf"]})
        found["files"] = [file["path"] for file in parsed(exported)["files"]]
        found["wood"] = parsed(await client.call_tool("materials", {"name": "white oak"}))["family"]
        try:
            await client.call_tool("inspect", {"scene": "/etc"})
        except MCPError as error:
            found["outside"] = error.error.code
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        async with Client(SERVER, list_roots_callback=roots) as client:
            scene = await client.call_tool("inspect", {"scene": "."})
            found["narrowed"] = len(scene.content) > 0
            try:
                await client.call_tool("audit", {"paths": [f"{ROOT}/model"]})
            except MCPError as error:
                found["narrowed_out"] = error.error.code
    print(json.dumps(found))


asyncio.run(main())
