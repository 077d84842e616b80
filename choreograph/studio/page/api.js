// Requests to the server of the studio. Answers are JSON, errors have one line that says what is wrong.

export class ApiError extends Error {
  constructor(status, body) {
    super(body?.error ?? `the server answered with ${status}`);
    this.status = status;
    this.state = body?.state ?? null; // the newest state, if another page was faster
  }
}

async function request(path, options = {}) {
  let answer;
  try {
    answer = await fetch(`/api/${path}`, options);
  } catch {
    throw new ApiError(0, { error: "The studio does not answer. Is it still running in the terminal?" });
  }
  const body = await answer.json().catch(() => null);
  if (!answer.ok) throw new ApiError(answer.status, body);
  return body;
}

export const get = (path) => request(path);

export const post = (path, body = {}, method = "POST") =>
  request(path, { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });

export const put = (path, body) => post(path, body, "PUT");
export const remove = (path) => request(path, { method: "DELETE" });

// The bytes of a file. Names are sent encoded, since headers are ASCII.
export const upload = (path, file) =>
  request(path, {
    method: "POST",
    headers: { "Content-Type": "application/octet-stream", "X-Filename": encodeURIComponent(file.name) },
    body: file,
  });

// The paths that this server has, so that the page offers only what works.
export async function serverPaths() {
  const answer = await fetch("/api/openapi.json");
  return new Set(answer.ok ? Object.keys((await answer.json()).paths) : []);
}

export const query = (values) =>
  new URLSearchParams(Object.entries(values).filter(([, value]) => value !== "" && value !== null && value !== undefined)).toString();
