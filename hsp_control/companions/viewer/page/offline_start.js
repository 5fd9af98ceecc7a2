// Unpack and run the scripts; offline.js then shows the content.
"use strict";

async function unzipped(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function showError(message) {
  const paragraph = document.createElement("p");
  paragraph.className = "error";
  paragraph.textContent = message;
  document.body.append(paragraph);
}

(async () => {
  if (typeof DecompressionStream === "undefined") {
    return showError("This page needs a browser of 2023 or newer.");
  }
  for (const code of JSON.parse(new TextDecoder().decode(await unzipped("scripts")))) {
    const script = document.createElement("script");
    script.textContent = code;
    document.head.append(script);
  }
  begin(await unzipped("content"));
})().catch((error) => {
  showError(`This page cannot be shown: ${error.message}. Does the browser support WebGL?`);
  throw error;
});
