// Unpack and run the scripts; offline.js then shows the content.
"use strict";

async function unzipped(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

(async () => {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("it needs a browser of 2023 or newer");
  }
  for (const code of JSON.parse(new TextDecoder().decode(await unzipped("scripts")))) {
    document.head.append(Object.assign(document.createElement("script"), {textContent: code}));
  }
  begin(await unzipped("content"));
})().catch((error) => {
  const textContent = `This page cannot be shown: ${error.message}.`;
  const paragraph = Object.assign(document.createElement("p"), {className: "error", textContent});
  document.body.append(paragraph);
  throw error;
});
