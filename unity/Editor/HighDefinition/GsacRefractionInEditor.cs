using UnityEditor;

namespace Gsac
{
    /// <summary>As in players, also while nothing plays.</summary>
    [InitializeOnLoad]
    static class GsacRefractionInEditor
    {
        static GsacRefractionInEditor()
        {
            GsacRefraction.Tell();
        }
    }
}
