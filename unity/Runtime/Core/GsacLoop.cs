namespace Gsac
{
    /// <summary>Whether clips of a file begin anew after their end.</summary>
    public enum GsacLoop
    {
        AsInFile,
        Once,
        Always,
    }
}
