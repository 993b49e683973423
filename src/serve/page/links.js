// Links to what is shown: #robot=ID and #body=ROW/ROW/….

// What the address names, if anything.
export const named = () => {
  const of = new URLSearchParams(location.hash.slice(1));
  const robot = of.get("robot"), body = of.get("body");
  if (robot) return { robot };
  return body && /^[0-6]+(\/[0-6]+)*$/.test(body) ? { body: body.split("/").map((row) => [...row].map(Number)) } : null;
};

// The address of what is shown, to be copied from the browser.
export const name = (value) => history.replaceState(null, "", value.robot ? `#robot=${value.robot}` : `#body=${value.body.map((row) => row.join("")).join("/")}`);
