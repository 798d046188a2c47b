/* The theme's script wraps tables, and adds a <nav> to each block of code. Here a table that scrolls can be reached with
   the keyboard, and such a <nav>, which has one button, is no landmark. */
const sizes = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    if (target.scrollWidth > target.clientWidth) target.tabIndex = 0;
    else target.removeAttribute("tabindex");
  }
});

const improve = () => {
  for (const nav of document.querySelectorAll(".md-code__nav:not([role])")) nav.setAttribute("role", "none");
  for (const table of document.querySelectorAll(".md-typeset__scrollwrap:not([role])")) {
    table.setAttribute("role", "group");
    table.setAttribute("aria-label", "Table");
    sizes.observe(table);
  }
};

new MutationObserver(improve).observe(document.querySelector("main"), { childList: true, subtree: true });
improve();
