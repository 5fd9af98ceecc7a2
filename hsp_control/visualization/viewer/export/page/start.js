// Unpack the scripts, then let export.js show the content.
"use strict";

async function unzipped(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function complain(reason) {
  const words = document.createElement("p");
  words.className = "complaint";
  words.textContent = reason;
  document.body.append(words);
}

(async () => {
  if (typeof DecompressionStream === "undefined") {
    return complain("This page needs a browser of 2023 or newer.");
  }
  for (const code of JSON.parse(new TextDecoder().decode(await unzipped("scripts")))) {
    const script = document.createElement("script");
    script.textContent = code;
    document.head.append(script);
  }
  begin(await unzipped("content"));
})().catch((error) => {
  complain(`This page cannot be shown: ${error.message}. Does the browser have WebGL?`);
  throw error;
});
