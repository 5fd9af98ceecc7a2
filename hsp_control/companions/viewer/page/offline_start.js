// Unpack and run the scripts; offline.js then shows the content.
"use strict";

async function unzipped(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function showError(textContent) {
  const paragraph = document.createElement("p");
  document.body.append(Object.assign(paragraph, {className: "error", textContent}));
}

(async () => {
  if (typeof DecompressionStream === "undefined") {
    return showError("This page needs a browser of 2023 or newer.");
  }
  for (const code of JSON.parse(new TextDecoder().decode(await unzipped("scripts")))) {
    document.head.append(Object.assign(document.createElement("script"), {textContent: code}));
  }
  begin(await unzipped("content"));
})().catch((error) => {
  showError(`This page cannot be shown: ${error.message}. Does the browser support WebGL?`);
  throw error;
});
